//! Tests: the shaders' formulas give the same values as their Rust twins on random input, on any
//! adapter.

use glam::{Vec3, Vec4};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use wgpu::util::DeviceExt;

use super::Gpu;
use crate::oval::{Oval, PackedOval};
use crate::ply::{self, YarnPoint};
use crate::shade::{self, LayerRelief, Surface, schlick_rough};
use crate::sheen::Sheen;
use crate::{Background, GpuError, tone};
use warpknit_shaders as shaders;

/// Number of random inputs of each formula; each has four times four numbers.
const COUNT: usize = 4096;
type Input = [Vec4; 4];

const RUN: &str = "
@group(3) @binding(8) var<storage, read> inputs: array<mat4x4f>;
@group(3) @binding(9) var<storage, read_write> outputs: array<vec4f>;
@compute @workgroup_size(64)
fn run(@builtin(global_invocation_id) id: vec3u) {
    outputs[id.x] = formula(inputs[id.x]);
}
";

/// The twin of [`direction`].
const DIRECTION: &str = "
fn direction(u: vec2f) -> vec3f {
    let height = 2.0 * u.x - 1.0;
    let around = sqrt(max(1.0 - height * height, 0.0));
    return vec3f(cos(TAU * u.y) * around, sin(TAU * u.y) * around, height);
}
";

/// An adapter to test on. Without one, the test is skipped; in CI it fails.
pub(super) fn adapter(test: &str) -> Option<Gpu> {
    opened(test, Gpu::find(true))
}

/// A device that a test may break. Without an adapter, as [`adapter`].
pub(super) fn adapter_to_break(test: &str) -> Option<Gpu> {
    opened(test, Gpu::alone(true))
}

fn opened(test: &str, found: Result<Gpu, GpuError>) -> Option<Gpu> {
    match found {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("WARPKNIT_CI").is_none(), "{error}");
            eprintln!("{test}: skipped, {error}");
            None
        }
    }
}

/// Runs `formula(input: mat4x4f) -> vec4f`, WGSL that is appended to `source`, on the device.
fn on_device(gpu: &Gpu, source: &str, formula: &str, inputs: &[Input]) -> Vec<Vec4> {
    let source = format!("{source}{formula}{RUN}");
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("run"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let usage = wgpu::BufferUsages::STORAGE;
    let contents = bytemuck::cast_slice(inputs);
    let given = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents,
        usage,
    });
    let buffer = |usage| {
        let size = (inputs.len() * size_of::<Vec4>()) as u64;
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage,
            mapped_at_creation: false,
        })
    };
    let found = buffer(usage | wgpu::BufferUsages::COPY_SRC);
    let read = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let entries = [(8, &given), (9, &found)].map(|(binding, buffer)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    });
    let layout = pipeline.get_bind_group_layout(3);
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &layout,
        entries: &entries,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(3, &group, &[]);
        pass.dispatch_workgroups(u32::try_from(inputs.len() / 64).unwrap(), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&found, 0, &read, 0, read.size());
    gpu.queue.submit([encoder.finish()]);
    read.slice(..).map_async(wgpu::MapMode::Read, |result| result.unwrap());
    gpu.wait().unwrap();
    let outputs = read.slice(..).get_mapped_range().unwrap();
    bytemuck::pod_collect_to_vec(&outputs)
}

/// Random numbers 0..1, the same in every run.
fn random() -> Vec<Input> {
    let numbers = prop::array::uniform16(0.0_f32..1.0).prop_map(|n| {
        let row = |at: usize| Vec4::new(n[at], n[at + 1], n[at + 2], n[at + 3]);
        [row(0), row(4), row(8), row(12)]
    });
    let mut runner = TestRunner::deterministic();
    (0..COUNT).map(|_| numbers.new_tree(&mut runner).unwrap().current()).collect()
}

fn direction(u: Vec4) -> Vec3 {
    let height = 2.0 * u.x - 1.0;
    let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
    let around = (1.0 - height * height).max(0.0).sqrt();
    Vec3::new(cos * around, sin * around, height)
}

/// Asserts that no component differs by more than `limit`, relative to its size or to 1, whichever
/// is larger. `spared` of a thousand may differ more.
fn assert_close(found: &[Vec4], expected: &[Vec4], limit: f32, spared: usize) {
    let far = |(found, expected): &(&Vec4, &Vec4)| {
        let off = (**found - **expected).abs() / expected.abs().max(Vec4::ONE);
        // Not a number counts as far.
        !off.cmple(Vec4::splat(limit)).all()
    };
    let misses: Vec<_> = found.iter().zip(expected).filter(far).collect();
    assert!(
        misses.len() * 1000 <= spared * found.len(),
        "{} of {}: {:?}",
        misses.len(),
        found.len(),
        misses.first()
    );
}

#[test]
fn the_open_sky_is_the_same() {
    let Some(gpu) = adapter("the_open_sky_is_the_same") else { return };
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    let before = (u[0].x - 0.5) * 40.0;
    let relief = LayerRelief(before, u[1].x * 5.0, u[0].z);
    let other = u[0].y > 0.8;
    let open = sky_visibility(relief, other, u[0].w);
    return vec4f(open, sky_visibility_of_ribbon(before, other, u[0].z, u[0].w), 0.0, 0.0);
}";
    let inputs = random();
    let found = on_device(&gpu, shaders::YARN, formula, &inputs);
    let expected = |u: &Input| {
        let before = (u[0].y <= 0.8).then_some((u[0].x - 0.5) * 40.0);
        let relief = LayerRelief { before, deviation: u[1].x * 5.0, cover: u[0].z };
        let open = shade::sky_visibility(&relief, u[0].w);
        Vec4::new(open, shade::sky_visibility_of_ribbon(before, u[0].z, u[0].w), 0.0, 0.0)
    };
    assert_close(&found, &inputs.iter().map(expected).collect::<Vec<_>>(), 1e-5, 0);
}

/// The yarn shader for flattened yarns.
fn flattened_yarn() -> String {
    let flattened =
        shaders::YARN.replace("override FLATTENED: bool = false", "const FLATTENED: bool = true");
    assert!(flattened != shaders::YARN);
    flattened
}

#[test]
fn sections_are_the_same() {
    let Some(gpu) = adapter("sections_are_the_same") else { return };
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    let tangent = direction(u[0].xy);
    let q = cross(tangent, direction(u[0].zw)) * sqrt(0.9 * u[1].x);
    let width = normalize(cross(tangent, direction(u[1].zw)));
    let front = cross(width, tangent);
    let seen = section_seen(q, width, front, u[1].y);
    let place = surface_place(q, width, front, 2.0 * u[2].x - 1.0, u[1].y);
    let facing = place_facing(q, width, u[1].y);
    let probe = vec3f(0.6, 0.3, 0.8);
    return vec4f(seen.half_width, seen.rise, dot(place.offset + facing, probe), dot(place.outward, probe));
}";
    let inputs = random();
    let twin = |u: &Input| {
        let zw = |v: Vec4| direction(Vec4::new(v.z, v.w, 0.0, 0.0));
        let (tangent, radius) = (direction(u[0]), u[1].y);
        let oval = Oval::new(tangent.cross(zw(u[0])) * (0.9 * u[1].x).sqrt());
        let width = tangent.cross(zw(u[1])).normalize();
        let front = width.cross(tangent);
        let half = radius * oval.height();
        let side = 2.0 * u[2].x - 1.0;
        let round_front = oval.shrunk(front).normalize();
        let round = tangent.cross(round_front) * side + round_front * (1.0 - side * side).sqrt();
        let offset = oval.grown(round) * half + oval.place_facing(width) * half;
        let probe = Vec3::new(0.6, 0.3, 0.8);
        Vec4::new(
            half * oval.reach(width),
            half / oval.shrunk(front).length(),
            offset.dot(probe),
            oval.shrunk(round).normalize().dot(probe),
        )
    };
    let expected: Vec<_> = inputs.iter().map(twin).collect();
    let source = flattened_yarn();
    let found = on_device(&gpu, &source, &format!("{DIRECTION}{formula}"), &inputs);
    assert_close(&found, &expected, 1e-3, 2);
}

#[test]
fn packed_sections_are_the_same() {
    let Some(gpu) = adapter("packed_sections_are_the_same") else { return };
    // Floats hold the upper and the lower half of the bits.
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    return vec4f(unpack_oval((u32(u[3].x) << 16u) | u32(u[3].y)), 0.0);
}";
    let ovals: Vec<_> =
        random().iter().map(|u| Oval::new(u[0].truncate() * 2.0 - 1.0).pack()).collect();
    let halves = |packed: &PackedOval| {
        let [low, high] = bytemuck::cast::<PackedOval, [u16; 2]>(*packed).map(f32::from);
        [Vec4::ZERO, Vec4::ZERO, Vec4::ZERO, Vec4::new(high, low, 0.0, 0.0)]
    };
    let inputs: Vec<Input> = ovals.iter().map(halves).collect();
    let expected: Vec<_> =
        ovals.iter().map(|packed| packed.unpack().vector().extend(0.0)).collect();
    assert_close(&on_device(&gpu, shaders::YARN, formula, &inputs), &expected, 1e-6, 0);
}

#[test]
fn reflection_is_the_same() {
    let Some(gpu) = adapter("reflection_is_the_same") else { return };
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    let share = select(0.0, u[2].z, u[2].w > 0.3);
    let sheen = Sheen(share, u[3].w - 0.5, direction(vec2f(u[2].w, u[2].z)));
    let m = Material(direction(u[0].xy), u[1].xyz, u[2].x, u[2].y, sheen);
    let skylight = schlick_rough(reflectance(m), u[3].z, m.roughness).x;
    return vec4f(brdf(m, direction(u[0].zw), direction(u[3].xy)), skylight);
}";
    let inputs = random();
    let twin = |u: &Input| {
        let share = if u[2].w > 0.3 { u[2].z } else { 0.0 };
        let sheen = Sheen {
            share,
            slope: u[3].w - 0.5,
            tangent: direction(Vec4::new(u[2].w, u[2].z, 0.0, 0.0)),
        };
        let (normal, albedo) = (direction(u[0]), u[1].truncate());
        let surface = Surface { normal, albedo, roughness: u[2].x, metallic: u[2].y, sheen };
        let toward = Vec4::new(u[0].z, u[0].w, 0.0, 0.0);
        let skylight = schlick_rough(surface.f0(), u[3].z, surface.roughness).x;
        surface.brdf(direction(toward), direction(u[3])).extend(skylight)
    };
    let expected: Vec<_> = inputs.iter().map(twin).collect();
    assert!(
        expected.iter().filter(|f| f.x > 0.0).count() > COUNT / 8,
        "light and eye are often enough on one side"
    );
    assert_close(
        &on_device(&gpu, shaders::YARN, &format!("{DIRECTION}{formula}"), &inputs),
        &expected,
        1e-3,
        2,
    );
}

#[test]
fn sheens_of_yarns_and_skies_are_the_same() {
    let Some(gpu) = adapter("sheens_of_yarns_and_skies_are_the_same") else { return };
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    let s = Sheen(u[0].x, u[0].y - 0.5, direction(u[0].zw));
    let toward_light = direction(u[1].xy);
    let toward_eye = direction(u[1].zw);
    let height = dot(sheen_highlight_normal(s, toward_light, toward_eye), vec3f(0.6, 0.0, 0.8));
    return vec4f(
        sheen_mean_over_width(s, toward_light, toward_eye),
        sheen_base_share_under_sky(s, u[2].z),
        sheen_sky_reflectance(s, direction(u[2].xy), toward_eye),
        height,
    );
}";
    let inputs = random();
    let twin = |u: &Input| {
        let [tangent, view] = [u[0], u[1]].map(|row| direction(Vec4::new(row.z, row.w, 0.0, 0.0)));
        let light = direction(u[1]);
        let sheen = Sheen { share: u[0].x, slope: u[0].y - 0.5, tangent };
        let height = sheen.highlight_normal(light, view).dot(Vec3::new(0.6, 0.0, 0.8));
        Vec4::new(
            sheen.mean_over_width(light, view),
            sheen.base_share_under_sky(u[2].z),
            sheen.sky_reflectance(direction(u[2]), view),
            height,
        )
    };
    let expected: Vec<_> = inputs.iter().map(twin).collect();
    assert!(expected.iter().filter(|f| f.x > 0.01).count() > COUNT / 8, "many shine");
    assert_close(
        &on_device(&gpu, shaders::YARN, &format!("{DIRECTION}{formula}"), &inputs),
        &expected,
        1e-3,
        2,
    );
}

#[test]
fn plies_and_fibres_are_the_same() {
    let Some(gpu) = adapter("plies_and_fibres_are_the_same") else { return };
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    let angle = TAU * (u[0].x - 0.5);
    let normal = vec3f(cos(angle), sin(angle), 0.0);
    let toward_eye = normalize(normal + u[1].xyz - 0.5);
    let plies = floor(1.0 + 4.0 * u[0].w);
    let detail = ply_detail(YarnPoint(
        normal, toward_eye, vec3f(0.0, 0.0, 1.0), angle, u[0].y * 5.0, 0.02 + u[0].z,
        u[2].x * u[2].x, plies, u[2].y, u[2].z - 0.5,
    ));
    return vec4f(detail.normal, detail.shade);
}";
    let inputs = random();
    let twin = |u: &Input| {
        let around = std::f32::consts::TAU * (u[0].x - 0.5);
        let normal = Vec3::new(around.cos(), around.sin(), 0.0);
        let plies = (1.0 + 4.0 * u[0].w).floor();
        let place = YarnPoint {
            normal,
            toward_eye: (normal + u[1].truncate() - 0.5).normalize(),
            tangent: Vec3::Z,
            around,
            along: u[0].y * 5.0,
            radius: 0.02 + u[0].z,
            footprint: u[2].x * u[2].x,
            plies,
            // One slope in Rust, that of what is twisted last: of fibres where there is one ply.
            twist_slope: Some(if plies > 1.0 { u[2].y } else { u[2].z - 0.5 }),
        };
        let (normal, shade) = ply::detail(&place);
        normal.extend(shade)
    };
    let [_, own] = ply::slopes(3.0, None);
    let with_own_fibres = formula
        .replace("u[2].z - 0.5,\n", &format!("select(u[2].z - 0.5, {own:?}, plies > 1.0),\n"));
    let expected: Vec<_> = inputs.iter().map(twin).collect();
    // Where a fibre's noise changes cell, rounding decides.
    assert_close(&on_device(&gpu, shaders::YARN, &with_own_fibres, &inputs), &expected, 2e-3, 5);
}

#[test]
fn the_tone_curve_is_the_same() {
    let Some(gpu) = adapter("the_tone_curve_is_the_same") else { return };
    let formula = "
fn formula(u: mat4x4f) -> vec4f {
    let light = u[0].xyz * 3.0;
    return vec4f(encode(mix(linear(u[1].xyz), shoulder(light * u[2].x), u[2].y)), 1.0);
}";
    let inputs: Vec<Input> =
        random().into_iter().map(|u| [u[0], (u[1] * 255.0).round() / 255.0, u[2], u[3]]).collect();
    let twin = |u: &Input| {
        let coverage = u[2].y.max(1e-6);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bytes")]
        let background = Background::Color(
            (u[1] * 255.0).to_array().map(|c| c.round() as u8)[..3].try_into().unwrap(),
        );
        let light = (u[0].truncate() * 3.0 * coverage).extend(coverage);
        let [r, g, b, a] =
            tone::pixel(light, Vec4::ZERO, u[2].x, background).map(|byte| f32::from(byte) / 255.0);
        Vec4::new(r, g, b, a)
    };
    let expected: Vec<_> = inputs.iter().map(twin).collect();
    // Half a byte's rounding.
    assert_close(&on_device(&gpu, shaders::TONE, formula, &inputs), &expected, 2.5e-3, 0);
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(gpu) = adapter_to_break("a_lost_device_is_an_error") else { return };
    gpu.device.destroy();
    let mut scene = crate::scene::Scene::default();
    scene.looks.push(crate::scene::YarnLook::plain(Vec3::ONE, 0.5, 0.1));
    scene.push_strand([Vec3::ZERO, Vec3::X], 0);
    let options = crate::RenderOptions { width: 16, height: 16, ..Default::default() };
    let camera = crate::Camera::view(crate::View::Front, &scene.positions, 0.5, 1.0, 1.0);
    let drawn = super::Renderer::new(gpu, options.samples).and_then(|mut renderer| {
        let yarns = renderer.load(&scene, options.st)?;
        renderer.draw(&yarns, &camera, &options)
    });
    let error = drawn.unwrap_err();
    assert!(error.to_string().contains("--renderer cpu"), "{error}");
}

#[test]
fn memory_that_is_refused_is_an_error() {
    let Some(gpu) = adapter_to_break("memory_that_is_refused_is_an_error") else { return };
    let size = gpu.device.limits().max_buffer_size + 4;
    let usage = wgpu::BufferUsages::STORAGE;
    let _invalid = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size,
        usage,
        mapped_at_creation: false,
    });
    assert!(gpu.fault().unwrap_err().to_string().contains("--renderer cpu"));
}
