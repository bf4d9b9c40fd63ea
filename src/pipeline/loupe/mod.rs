//! The loupe: a round inset in a picture of a garment that magnifies a place until loops can be
//! seen.
//!
//! In: a garment, a fabric, the picture's camera, and where to look. Out: a [`Loupe`], whose camera
//! shows that place from the same eye, in the same light, so many times larger. The inset is a
//! picture of its own, of cloth that is knitted for it, and no enlarged part of the other one.
//!
//! Unless a place is chosen, it is one near the picture's middle where a panel faces the camera in the sun. The
//! inset lies where it hides least cloth, and near the place among places that hide as little. Both
//! are found on a coarse grid ([`silhouette`]), in some milliseconds. Not promised: a place in the
//! sun, if few places near the middle are.

mod frame;
mod silhouette;

use glam::{DVec2, DVec3, UVec2};
use image::RgbaImage;

use super::RunError;
use super::settings::LoupeChoice;
use crate::garment::Garment;
use crate::render::{Camera, Light};
use frame::{Disc, Lines};
use silhouette::{ShownPoint, Silhouette, direction, in_picture, is_shadowed, shown_at};

/// Width of a wale in a picture, pixels, below which loops are no longer seen: the loupe is then on
/// unless that is chosen otherwise.
const SEEN_PIXELS: f64 = 4.0;
/// Wales across the inset. With more, loops become texture; with fewer, the pattern of a repeat
/// does not show.
const WALES: f64 = 14.0;
/// Width of a wale in the inset at least, pixels. Below it loops do not read.
const LEAST_WALE: f64 = 16.0;
/// The inset's diameter, as a share of the picture's shorter side.
const SHARE: f64 = 0.4;
/// The smallest inset that is made unasked, pixels.
const LEAST_INSET: f64 = 96.0;
/// The inset's distance from the picture's borders and from cloth, as a share of the picture's
/// shorter side.
const MARGIN: f64 = 0.025;
/// Radius of the mark at least, as a share of the picture's shorter side, so that it is found.
const LEAST_MARK: f64 = 0.008;
/// Width of the frame, as a share of the picture's shorter side.
const LINE: f64 = 0.0022;
/// How much a place loses by its distance from the picture's middle, in half diagonals, against the
/// cosine at which it faces the camera.
const OFF_MIDDLE: f64 = 0.6;
/// How much a place gains by the cosine at which it faces the sun, against the same.
const SUNNY: f64 = 0.5;
/// Places that are tried before one in the shadow is taken.
const MOST_SHADOWED: usize = 2000;
/// Cloth so near the place, in wales, that it casts no shadow: the panel itself, where it is bent.
const SHADOW_WALES: f64 = 10.0;

/// A loupe in a picture.
#[derive(Debug)]
pub(super) struct Loupe {
    lines: Lines,
    camera: Camera,
    /// Width and height of the inset, pixels.
    side: u32,
    /// How much larger than the picture the inset shows cloth.
    pub(super) times: f64,
    /// The place, as shares of the picture's width and height from the top left corner.
    pub(super) place: DVec2,
}

impl Loupe {
    /// Finds the loupe of a picture of so many pixels. `wale` is the wale spacing, mm. `None` if it
    /// is switched off; or if nobody chose, and loops are seen without it, or there is no place for
    /// it.
    ///
    /// # Errors
    /// [`RunError::LoupeOffCloth`] if the chosen place shows no cloth.
    pub(super) fn find(
        choice: LoupeChoice,
        garment: &Garment,
        wale: f64,
        (camera, light): (&Camera, &Light),
        [width, height]: [u32; 2],
    ) -> Result<Option<Self>, RunError> {
        let picture = DVec2::new(f64::from(width), f64::from(height));
        // An even side, so that the inset's pixels lie on the picture's.
        let radius = (SHARE / 2.0 * picture.min_element()).round();
        let wale_in = |shown: &ShownPoint| wale / camera.pixel_size(shown.distance, height);
        let (silhouette, place, shown) = match choice {
            LoupeChoice::Off => return Ok(None),
            LoupeChoice::At(share) => {
                let place = share * picture;
                let shown = shown_at(garment, camera, picture, place)
                    .ok_or(RunError::LoupeOffCloth { at: share })?;
                (Silhouette::new(garment, camera, picture), place, shown)
            }
            LoupeChoice::Auto => {
                if 2.0 * radius < LEAST_INSET {
                    return Ok(None);
                }
                let silhouette = Silhouette::new(garment, camera, picture);
                let Some((place, shown)) =
                    good_place(&silhouette, garment, wale, (camera, light), picture)
                else {
                    return Ok(None);
                };
                if wale_in(&shown) >= SEEN_PIXELS {
                    return Ok(None);
                }
                (silhouette, place, shown)
            }
        };
        let radius = radius.max(1.0);
        // A chosen place may show loops already: the loupe never makes them smaller.
        let times = ((2.0 * radius / WALES).max(LEAST_WALE) / wale_in(&shown)).max(1.0);
        let least = LEAST_MARK * picture.min_element();
        let mark = Disc { middle: place, radius: (radius / times).max(least) };
        let inset = Disc { middle: inset_place(&silhouette, picture, mark, radius), radius };
        let width = (LINE * picture.min_element()).max(1.0);
        let aspect = picture.x / picture.y;
        let at = in_picture(picture, place);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some hundred")]
        let side = (2.0 * radius) as u32;
        Ok(Some(Self {
            lines: Lines { inset, mark, width },
            camera: camera.part(at, aspect, 2.0 * radius / times / picture.y),
            side,
            times,
            place: place / picture,
        }))
    }

    /// The camera of the inset.
    pub(super) fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Width and height of the inset, pixels.
    pub(super) fn size(&self) -> [u32; 2] {
        [self.side; 2]
    }

    /// Draws the inset, its frame and the mark into a picture whose first row is `first_row` of the
    /// whole.
    pub(super) fn draw(&self, picture: &mut RgbaImage, first_row: u32, inset: &RgbaImage) {
        self.lines.draw(picture, first_row, inset);
    }

    /// What a person may want to know of it.
    pub(super) fn note(&self) -> String {
        let Self { times, place, .. } = self;
        format!(
            "the loupe magnifies the place {:.3},{:.3} of the picture {times:.0} times; --loupe X,Y \
             looks elsewhere, and --loupe off leaves it out",
            place.x, place.y
        )
    }
}

/// The place near the picture's middle where a panel faces the camera and the sun best, and lies in
/// no shadow if there is such a place.
fn good_place(
    silhouette: &Silhouette,
    garment: &Garment,
    wale: f64,
    (camera, light): (&Camera, &Light),
    picture: DVec2,
) -> Option<(DVec2, ShownPoint)> {
    let toward_sun = light.around(camera).toward_sun.as_dvec3();
    let mut found: Vec<(f64, DVec2, DVec3, ShownPoint)> = Vec::new();
    for cell in silhouette.cells() {
        let (Some(shown), at) = (silhouette.at(cell), silhouette.middle(cell)) else { continue };
        if !is_within(silhouette, cell, shown) {
            continue;
        }
        let off = at.distance(picture / 2.0) / (picture.length() / 2.0);
        let direction = direction(camera, picture, at);
        let score =
            shown.normal.dot(-direction) + SUNNY * shown.normal.dot(toward_sun) - OFF_MIDDLE * off;
        found.push((score, at, camera.eye() + direction * shown.distance, shown));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = found.iter().take(MOST_SHADOWED);
    let lit = best
        .clone()
        .find(|(.., place, _)| !is_shadowed(garment, *place, toward_sun, SHADOW_WALES * wale));
    lit.or_else(|| best.next()).map(|(_, at, _, shown)| (*at, *shown))
}

/// Whether the cells around a cell show the same panel, so that no edge or seam is near.
fn is_within(silhouette: &Silhouette, cell: UVec2, shown: ShownPoint) -> bool {
    let UVec2 { x: width, y: height } = silhouette.size;
    if cell.x == 0 || cell.y == 0 || cell.x + 1 >= width || cell.y + 1 >= height {
        return false;
    }
    (cell.y - 1..=cell.y + 1).all(|y| {
        (cell.x - 1..=cell.x + 1)
            .all(|x| silhouette.at(UVec2::new(x, y)).is_some_and(|near| near.panel == shown.panel))
    })
}

/// Where the middle of an inset of this radius lies: where it hides least cloth, and the less the
/// nearer that is to the picture's middle; near the mark, but not on it.
fn inset_place(silhouette: &Silhouette, picture: DVec2, mark: Disc, radius: f64) -> DVec2 {
    let margin = MARGIN * picture.min_element();
    let reach = radius + margin;
    let (low, high) = (DVec2::splat(reach), picture - reach);
    // Every second cell will do.
    let steps = ((high - low) / (2.0 * silhouette.cell)).floor().max(DVec2::ZERO).as_uvec2();
    let mut best = (f64::INFINITY, picture / 2.0);
    for y in 0..=steps.y {
        for x in 0..=steps.x {
            let share = UVec2::new(x, y).as_dvec2() / steps.max(UVec2::ONE).as_dvec2();
            let middle = low + (high - low).max(DVec2::ZERO) * share;
            let apart = middle.distance(mark.middle);
            if apart < reach + mark.radius {
                continue;
            }
            let hidden = hidden(silhouette, picture, Disc { middle, radius: reach });
            // A diagonal counts as one hidden cell, so that the way to the mark only decides among
            // places that hide as much.
            let cost = hidden + apart / picture.length();
            if cost < best.0 {
                best = (cost, middle);
            }
        }
    }
    best.1.round()
}

/// Number of cells with cloth in a disc. Those in the picture's middle count twice as much as those
/// in its corners.
fn hidden(silhouette: &Silhouette, picture: DVec2, disc: Disc) -> f64 {
    let Disc { middle, radius } = disc;
    let clip = |at: DVec2| (at / silhouette.cell).floor().max(DVec2::ZERO).as_uvec2();
    let (low, high) = (clip(middle - radius), clip(middle + radius).min(silhouette.size - 1));
    let mut sum = 0.0;
    for y in low.y..=high.y {
        for x in low.x..=high.x {
            let cell = UVec2::new(x, y);
            let at = silhouette.middle(cell);
            if at.distance(middle) < radius && silhouette.at(cell).is_some() {
                sum += 2.0 - at.distance(picture / 2.0) / (picture.length() / 2.0);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::View;
    use glam::Vec3;

    const SIZE: [u32; 2] = [800, 600];

    /// A camera that sees a rectangle in the left half of the picture.
    fn beside(garment_width: f32) -> (Garment, Camera) {
        let corners = [Vec3::ZERO, Vec3::new(2.0 * garment_width, 1.5 * garment_width, 0.0)];
        let camera = Camera::view(View::Front, &corners, Camera::DEFAULT_FOV, 1.0, 4.0 / 3.0);
        let side = f64::from(garment_width);
        (Garment::rectangle(side, 1.5 * side), camera)
    }

    fn find(choice: LoupeChoice, wale: f64) -> Result<Option<Loupe>, RunError> {
        let (garment, camera) = beside(500.0);
        Loupe::find(choice, &garment, wale, (&camera, &Light::default()), SIZE)
    }

    #[test]
    fn it_looks_at_cloth_and_lies_on_the_background() {
        let loupe = find(LoupeChoice::Auto, 0.7).unwrap().expect("a wale is under a pixel");
        let Lines { inset, mark, .. } = loupe.lines;
        assert_eq!(loupe.size(), [240; 2]);
        // Cloth takes the left half.
        assert!(mark.middle.x < 400.0 && mark.middle.x > 200.0, "{mark:?}");
        assert!(inset.middle.x - inset.radius > 400.0, "{inset:?}");
        let ends = [inset.middle - inset.radius, inset.middle + inset.radius];
        assert!(ends[0].min_element() >= 0.0 && ends[1].x <= 800.0 && ends[1].y <= 600.0);
        // A wale is as wide there as 14 of them across need.
        let wale = loupe.camera.project(DVec3::new(250.0, 375.0, 0.0), 1.0).unwrap()
            - loupe.camera.project(DVec3::new(249.3, 375.0, 0.0), 1.0).unwrap();
        assert!((120.0 * wale.x - 240.0 / WALES).abs() < 0.6, "{wale}");
    }

    #[test]
    fn its_camera_looks_at_the_chosen_place() {
        let at = DVec2::new(0.2, 0.3);
        let loupe = find(LoupeChoice::At(at), 0.7).unwrap().unwrap();
        let (_, camera) = beside(500.0);
        let ray = camera.direction(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 4.0 / 3.0);
        assert!(loupe.camera.direction(0.0, 0.0, 1.0).distance(ray) < 1e-9);
        assert_eq!(loupe.camera.eye(), camera.eye());
        assert!((loupe.place - at).length() < 1e-9);
    }

    #[test]
    fn it_is_off_where_loops_are_seen_or_nothing_is_and_where_it_is_switched_off() {
        assert!(find(LoupeChoice::Off, 0.7).unwrap().is_none());
        assert!(find(LoupeChoice::Auto, 7.0).unwrap().is_none());
        // Whoever chooses a place gets it all the same.
        assert!(find(LoupeChoice::At(DVec2::new(0.2, 0.3)), 7.0).unwrap().is_some());
        let wrong = find(LoupeChoice::At(DVec2::new(0.9, 0.3)), 0.7).unwrap_err().to_string();
        assert!(wrong.contains("0.9,0.3") && !wrong.contains('\n'), "{wrong}");
        let (garment, camera) = beside(500.0);
        let small =
            Loupe::find(LoupeChoice::Auto, &garment, 0.7, (&camera, &Light::default()), [160, 120]);
        assert!(small.unwrap().is_none());
    }

    #[test]
    fn where_cloth_fills_the_picture_it_lies_in_a_corner() {
        let garment = Garment::rectangle(400.0, 300.0);
        let middle = DVec3::new(200.0, 150.0, 0.0);
        let eye = middle + DVec3::Z * 500.0;
        let camera = Camera::look_at(eye, middle, Camera::DEFAULT_FOV, 1.0);
        let loupe =
            Loupe::find(LoupeChoice::Auto, &garment, 0.7, (&camera, &Light::default()), SIZE)
                .unwrap()
                .unwrap();
        let Lines { inset, mark, .. } = loupe.lines;
        assert!((mark.middle - DVec2::new(400.0, 300.0)).length() < 8.0, "{mark:?}");
        let from_border = inset.middle.min(DVec2::new(800.0, 600.0) - inset.middle);
        assert!((from_border - inset.radius).max_element() < 20.0, "{inset:?}");
    }
}
