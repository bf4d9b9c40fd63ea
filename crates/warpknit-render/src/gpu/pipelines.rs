//! Render pipelines and bind group layouts, created once for a device.
//!
//! Bind groups of the yarn shader: 0 the view, 1 a page of yarns, 2 textures, 3 depth maps. Depth
//! passes bind the first three only.

use std::collections::BTreeMap;

use wgpu::{
    BindGroupLayoutEntry as Entry, BindingType, BufferBindingType, ShaderStages, TextureSampleType,
};

use super::data;
use super::device::Gpu;
use super::{DEPTH, LIGHT, MOMENTS, PICTURE};
use warpknit_shaders as shaders;

/// How points are expanded into vertices: `SHAPE` of the yarn shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Expansion {
    Tube = 0,
    Strip = 1,
    Ribbon = 2,
}

/// Passes over the yarns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum PassKind {
    /// Depths with one sample, for depth maps.
    Depth,
    /// Depth pre-pass with the picture's samples, so that only visible fragments are shaded.
    /// Ribbons have none, because the light pass decides which of their samples are solid.
    Prepass,
    /// Light of solid fragments.
    Light,
    /// Light of translucent fragments, blended. Only for ribbons with textures.
    Fuzz,
}

/// Specialisation of a pipeline over the yarns. A software driver computes both sides of every
/// branch, so features that do not occur are compiled out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PipelineKey {
    pub(super) expansion: Expansion,
    pub(super) pass_kind: PassKind,
    pub(super) has_maps: bool,
    /// Whether yarns may have a sheen.
    pub(super) has_sheen: bool,
    pub(super) is_flattened: bool,
}

impl PipelineKey {
    /// Whether light is computed per vertex: for plain strips, see the shader.
    fn lit_per_vertex(self) -> bool {
        self.expansion == Expansion::Strip && !self.has_maps && self.pass_kind == PassKind::Light
    }

    /// Whether the pass has anything to draw.
    pub(super) fn is_drawn(self) -> bool {
        let is_ribbon = self.expansion == Expansion::Ribbon;
        match self.pass_kind {
            PassKind::Depth | PassKind::Light => true,
            // Light per vertex costs no more than the pre-pass that would hide it.
            PassKind::Prepass => !is_ribbon && (self.expansion == Expansion::Tube || self.has_maps),
            PassKind::Fuzz => is_ribbon && self.has_maps,
        }
    }
}

/// Layouts of the bind groups.
#[derive(Debug)]
pub(super) struct Layouts {
    pub(super) view: wgpu::BindGroupLayout,
    pub(super) page: wgpu::BindGroupLayout,
    pub(super) maps: wgpu::BindGroupLayout,
    pub(super) light: wgpu::BindGroupLayout,
    pub(super) moments: wgpu::BindGroupLayout,
    pub(super) tone: wgpu::BindGroupLayout,
}

/// The pipelines for one number of samples. Those over the yarns are compiled when they are first
/// needed, because compiling all of them takes half a second on a software driver.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) samples: u32,
    yarn: wgpu::ShaderModule,
    made: BTreeMap<PipelineKey, wgpu::RenderPipeline>,
    /// Filters of all depths: from a depth buffer, and from moments.
    pub(super) all: [wgpu::RenderPipeline; 2],
    /// Filters of the nearest layer's depths.
    pub(super) nearest: [wgpu::RenderPipeline; 2],
    pub(super) tone: wgpu::RenderPipeline,
}

const BOTH: ShaderStages = ShaderStages::VERTEX_FRAGMENT;

/// Layout entry of a buffer.
fn buffer(
    binding: u32,
    visibility: ShaderStages,
    ty: BufferBindingType,
    has_dynamic_offset: bool,
) -> Entry {
    let ty = BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None };
    Entry { binding, visibility, ty, count: None }
}

/// Layout entry of a texture.
fn texture(binding: u32, visibility: ShaderStages, sample_type: TextureSampleType) -> Entry {
    let ty = BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    Entry { binding, visibility, ty, count: None }
}

impl Layouts {
    pub(super) fn new(gpu: &Gpu) -> Self {
        const STORED: BufferBindingType = BufferBindingType::Storage { read_only: true };
        const UNIFORM: BufferBindingType = BufferBindingType::Uniform;
        let (filtered, exact) = (
            TextureSampleType::Float { filterable: true },
            TextureSampleType::Float { filterable: false },
        );
        let layout = |label, entries: &[Entry]| {
            gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries,
            })
        };
        let sampler = BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let sampler =
            Entry { binding: 3, visibility: ShaderStages::FRAGMENT, ty: sampler, count: None };
        let (vertex, pixel) = (ShaderStages::VERTEX, ShaderStages::FRAGMENT);
        Self {
            view: layout(
                "view",
                &[buffer(0, BOTH, UNIFORM, false), buffer(1, BOTH, STORED, false)],
            ),
            page: layout(
                "page",
                &[
                    buffer(0, vertex, STORED, false),
                    buffer(1, vertex, STORED, false),
                    buffer(2, vertex, STORED, false),
                    buffer(3, vertex, STORED, false),
                    buffer(4, vertex, UNIFORM, true),
                    buffer(5, vertex, STORED, false),
                ],
            ),
            maps: layout(
                "maps",
                &[
                    texture(0, pixel, filtered),
                    texture(1, pixel, filtered),
                    texture(2, pixel, filtered),
                    sampler,
                ],
            ),
            light: layout("light", &[texture(0, BOTH, exact), texture(1, BOTH, exact)]),
            moments: layout(
                "moments",
                &[
                    buffer(0, BOTH, UNIFORM, false),
                    texture(1, pixel, TextureSampleType::Depth),
                    texture(2, pixel, exact),
                ],
            ),
            tone: layout("tone", &[buffer(0, BOTH, UNIFORM, false), texture(1, pixel, exact)]),
        }
    }
}

impl Pipelines {
    /// Compiles the shaders.
    pub(super) fn new(gpu: &Gpu, layouts: &Layouts, samples: u32) -> Self {
        let [yarn, moments, tone] =
            [shaders::YARN, shaders::MOMENTS, shaders::TONE].map(|source| {
                let source = wgpu::ShaderSource::Wgsl(source.into());
                gpu.device
                    .create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source })
            });
        // In the order of `all` and `nearest`: depths of all layers, or of the nearest one.
        let [all, nearest] = [false, true].map(|is_layered| {
            [true, false].map(|from_depths| {
                let constants =
                    &[("LAYERED", switch(is_layered)), ("FROM_DEPTHS", switch(from_depths))];
                screen_pipeline(gpu, &layouts.moments, &moments, "average", MOMENTS, constants)
            })
        });
        Self {
            samples,
            yarn,
            made: BTreeMap::new(),
            all,
            nearest,
            tone: screen_pipeline(gpu, &layouts.tone, &tone, "tone_map", PICTURE, &[]),
        }
    }

    /// Compiles the pipeline for a key, unless it exists.
    pub(super) fn make(&mut self, gpu: &Gpu, layouts: &Layouts, key: PipelineKey) {
        if !self.made.contains_key(&key) {
            self.made.insert(key, yarn_pipeline(gpu, layouts, &self.yarn, key, self.samples));
        }
    }

    /// The pipeline for a key, if it was compiled.
    pub(super) fn made(&self, key: PipelineKey) -> Option<&wgpu::RenderPipeline> {
        self.made.get(&key)
    }
}

/// Compiles a pipeline over the yarns.
fn yarn_pipeline(
    gpu: &Gpu,
    layouts: &Layouts,
    module: &wgpu::ShaderModule,
    key: PipelineKey,
    samples: u32,
) -> wgpu::RenderPipeline {
    let PipelineKey { expansion, pass_kind, has_maps, has_sheen, is_flattened } = key;
    let samples = if pass_kind == PassKind::Depth { 1 } else { samples };
    let groups = if matches!(pass_kind, PassKind::Depth | PassKind::Prepass) { 3 } else { 4 };
    let groups =
        &[Some(&layouts.view), Some(&layouts.page), Some(&layouts.maps), Some(&layouts.light)]
            [..groups];
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    let is_fuzz = pass_kind == PassKind::Fuzz;
    let constants = &[
        ("SHAPE", f64::from(expansion as u32)),
        ("FUZZ", switch(is_fuzz)),
        ("MAPS", switch(has_maps)),
        ("SHEEN", switch(has_sheen)),
        ("FLATTENED", switch(is_flattened)),
    ];
    let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    let blend = is_fuzz.then_some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING);
    let light =
        [Some(wgpu::ColorTargetState { format: LIGHT, blend, write_mask: wgpu::ColorWrites::ALL })];
    let fragment = match pass_kind {
        // Depths need no fragment shader, except where a texture has holes.
        PassKind::Depth | PassKind::Prepass => {
            (expansion == Expansion::Ribbon && has_maps).then_some(("discard_fuzz", &[][..]))
        }
        PassKind::Light if key.lit_per_vertex() => Some(("lit", &light[..])),
        PassKind::Light | PassKind::Fuzz => Some(("shade", &light[..])),
    };
    let expand = if key.lit_per_vertex() { "expand_lit" } else { "expand" };
    let fragment = fragment.map(|(entry, targets)| wgpu::FragmentState {
        module,
        entry_point: Some(entry),
        compilation_options: compilation_options.clone(),
        targets,
    });
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(expand),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            // Tubes are closed, so their back faces are invisible. Ribbons and strips show both
            // sides.
            cull_mode: (expansion == Expansion::Tube).then_some(wgpu::Face::Back),
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            // Fuzz is tested against solid yarns but hides nothing itself.
            depth_write_enabled: Some(!is_fuzz),
            // Less or equal: the light pass meets exactly the depths of the pre-pass (`@invariant`
            // in the shader).
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: samples, ..wgpu::MultisampleState::default() },
        fragment,
        multiview_mask: None,
        cache: None,
    })
}

/// A boolean as the value of a shader's override constant.
fn switch(is_on: bool) -> f64 {
    f64::from(u8::from(is_on))
}

/// Compiles a pipeline over all pixels.
fn screen_pipeline(
    gpu: &Gpu,
    group: &wgpu::BindGroupLayout,
    module: &wgpu::ShaderModule,
    entry: &str,
    format: wgpu::TextureFormat,
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(entry),
        bind_group_layouts: &[Some(group)],
        immediate_size: 0,
    });
    let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("cover"),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(entry),
            compilation_options,
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Index buffer of an instance: rings with `edges` edges, or a flat strip for 2.
pub(super) fn indices(edges: u32) -> Vec<u16> {
    let around = if edges == 2 { 1 } else { edges };
    let corner = |step: u32, s: u32| {
        u16::try_from(step * edges + s % edges).expect("eight steps of 64 edges")
    };
    let mut indices = Vec::new();
    for (step, s) in (0..data::STEPS).flat_map(|step| (0..around).map(move |s| (step, s))) {
        // Two triangles for each quad between two rings, counter-clockwise from outside.
        let (a, b, c, d) =
            (corner(step, s), corner(step, s + 1), corner(step + 1, s), corner(step + 1, s + 1));
        indices.extend([a, b, c, b, d, c]);
    }
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instance_has_two_triangles_for_each_edge_and_step() {
        for edges in [2, 3, 6, 64] {
            let indices = indices(edges);
            let around = if edges == 2 { 1 } else { edges };
            assert_eq!(indices.len(), (2 * 3 * around * data::STEPS) as usize);
            assert_eq!(u32::from(*indices.iter().max().unwrap()) + 1, edges * (data::STEPS + 1));
        }
    }
}
