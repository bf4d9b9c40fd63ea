//! Location against brute force in exact arithmetic: every triangle in turn, signs by integers.
//!
//! All coordinates here are multiples of 2^-20 mm, so they are integers after scaling and their
//! cross products fit 128 bits.

use std::sync::mpsc;
use std::time::Duration;

use glam::{DAffine3, DVec2, DVec3};
use proptest::prelude::*;
use rayon::prelude::*;
use warpknit::garment::Panel;
use warpknit::ids::FaceId;
use warpknit::locate::Locator;

const UNIT: f64 = 1.0 / (1 << 20) as f64;

/// A small generator of its own, so that meshes are the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) ^ (self.0 >> 12)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 24) as f64 / (1 << 24) as f64
    }
}

fn quantised(p: DVec2) -> DVec2 {
    (p / UNIT).round() * UNIT
}

fn panel(uv: Vec<DVec2>, triangles: Vec<[u32; 3]>) -> Panel {
    Panel {
        draped: uv.iter().map(|p| p.extend(0.0)).collect(),
        normals: vec![DVec3::Z; uv.len()],
        faces: (0..triangles.len()).map(|face| FaceId(face as u32)).collect(),
        uv,
        triangles,
        flipped: Vec::new(),
        flat_from_panel: DAffine3::IDENTITY,
        mirrored: false,
        turned_in: None,
    }
}

/// A grid of cells with random diagonals and shuffled triangles; `jitter` moves inner vertices.
fn grid(across: u32, cell: f64, jitter: f64, random: &mut Random) -> Panel {
    let mut uv = Vec::new();
    for y in 0..=across {
        for x in 0..=across {
            let inner = x > 0 && y > 0 && x < across && y < across;
            let moved = DVec2::new(random.unit() - 0.5, random.unit() - 0.5)
                * if inner { jitter } else { 0.0 };
            uv.push(quantised((DVec2::new(f64::from(x), f64::from(y)) + moved) * cell));
        }
    }
    let mut triangles = Vec::new();
    for y in 0..across {
        for x in 0..across {
            let a = y * (across + 1) + x;
            let [b, c, d] = [a + 1, a + across + 2, a + across + 1];
            triangles.extend(if random.below(2) == 0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
    }
    for i in (1..triangles.len()).rev() {
        triangles.swap(i, random.below(i as u64 + 1) as usize);
    }
    panel(uv, triangles)
}

/// The paper's search: the first triangle of all that holds the point, by exact signs.
fn brute_force(panel: &Panel, p: DVec2) -> Option<u32> {
    let scaled = |v: DVec2| [(v.x / UNIT) as i128, (v.y / UNIT) as i128];
    let [px, py] = scaled(p);
    let found = panel.triangles.iter().position(|t| {
        let corner = t.map(|v| scaled(panel.uv[v as usize])).map(|[x, y]| [x - px, y - py]);
        let sign = |i: usize| {
            (corner[i][0] * corner[(i + 1) % 3][1] - corner[i][1] * corner[(i + 1) % 3][0]).signum()
        };
        let signs = [sign(0), sign(1), sign(2)];
        !(signs.contains(&1) && signs.contains(&-1))
    });
    found.map(|at| at as u32)
}

/// Points anywhere, on vertices, on edges, and on the lines of the grid.
fn points(panel: &Panel, extent: f64, count: usize, random: &mut Random) -> Vec<DVec3> {
    let mut points = Vec::new();
    for _ in 0..count {
        let t = panel.triangles[random.below(panel.triangles.len() as u64) as usize]
            .map(|v| panel.uv[v as usize]);
        let anywhere = DVec2::new(random.unit() * 1.2 - 0.1, random.unit() * 1.2 - 0.1) * extent;
        // Halves and quarters of differences of multiples of 4 units stay multiples of a unit, so
        // they lie exactly on the edge.
        let share = [0.25, 0.5, 0.75][random.below(3) as usize];
        let on_line = DVec2::new(anywhere.x, t[0].y);
        points.extend(
            [anywhere, t[0], t[1].lerp(t[2], share), on_line]
                .map(|p| quantised(p).extend(random.unit())),
        );
    }
    points
}

fn differences(panel: &Panel, points: &[DVec3]) -> usize {
    let located = Locator::new(panel).locate(points);
    let found = located.iter().map(|at| at.map(|at| at.triangle));
    found.zip(points).filter(|(found, p)| *found != brute_force(panel, p.truncate())).count()
}

#[test]
fn random_meshes_agree_with_brute_force() {
    let mut random = Random(1);
    for (across, jitter) in [(3, 0.3), (17, 0.45), (40, 0.7)] {
        let panel = grid(across, 7.3, jitter, &mut random);
        let points = points(&panel, 7.3 * f64::from(across), 2000, &mut random);
        assert_eq!(differences(&panel, &points), 0, "{across} cells across");
    }
}

#[test]
fn grid_aligned_meshes_agree_with_brute_force_on_their_edges_and_vertices() {
    let mut random = Random(2);
    let panel = grid(32, 8.0, 0.0, &mut random);
    let points = points(&panel, 256.0, 4000, &mut random);
    assert_eq!(differences(&panel, &points), 0);
    let inside = points.iter().filter(|p| p.x >= 0.0 && p.y >= 0.0 && p.x <= 256.0 && p.y <= 256.0);
    let on_edges = inside.filter(|p| p.x % 8.0 == 0.0 || p.y % 8.0 == 0.0).count();
    assert!(on_edges > 8000, "thousands of points lie exactly on edges or vertices: {on_edges}");
}

#[test]
fn yarns_across_holes_and_notches_agree_with_brute_force() {
    let mut random = Random(5);
    let mut panel = grid(30, 4.0, 0.5, &mut random);
    // Two holes and two notches, one of them a slit that is one cell wide.
    let is_cut = |p: DVec2| {
        let within = |low: [f64; 2], high: [f64; 2]| {
            p.cmpgt(DVec2::from(low)).all() && p.cmplt(DVec2::from(high)).all()
        };
        within([20.0, 20.0], [44.0, 36.0])
            || within([60.0, 20.0], [68.0, 90.0])
            || within([100.0, 50.0], [120.0, 80.0])
            || within([30.0, 60.0], [34.0, 120.0])
    };
    let middle = |t: &[u32; 3]| t.iter().map(|&v| panel.uv[v as usize]).sum::<DVec2>() / 3.0;
    panel.triangles = panel.triangles.iter().copied().filter(|t| !is_cut(middle(t))).collect();
    panel.faces.truncate(panel.triangles.len());
    // Rows that begin and end off the panel, far and near, on the lines of the grid and off them.
    for (step, rise) in [(0.25, 0.0), (1.0, 0.125), (7.0, 0.0), (31.0, 0.5)] {
        let row = |y: f64| {
            let count = (150.0 / step) as u32;
            (0..count).map(move |x| {
                DVec2::new(f64::from(x) * step - 15.0, y + f64::from(x % 8) * rise).extend(0.0)
            })
        };
        let points: Vec<_> = (0..60).flat_map(|y| row(f64::from(y) * 2.25 - 8.0)).collect();
        assert_eq!(differences(&panel, &points), 0, "a point every {step} mm");
        let on = points.iter().filter(|p| brute_force(&panel, p.truncate()).is_some()).count();
        assert!(on > points.len() / 3 && on < points.len() * 3 / 4, "{on} of {}", points.len());
    }
}

#[test]
fn no_point_of_the_panel_is_lost() {
    let mut random = Random(3);
    let panel = grid(25, 4.0, 0.6, &mut random);
    let points: Vec<_> = (0..20_000)
        .map(|_| quantised(DVec2::new(random.unit(), random.unit()) * 100.0).extend(0.0))
        .collect();
    let located = Locator::new(&panel).locate(&points);
    assert_eq!(located.iter().filter(|at| at.is_none()).count(), 0);
    for (at, point) in located.iter().flatten().zip(&points) {
        let corners =
            panel.triangles[at.triangle as usize].map(|v| panel.uv[v as usize].extend(0.0));
        assert!(
            (at.blend(corners).truncate() - point.truncate()).length() < 1e-9,
            "the weights give the point back"
        );
        assert!(at.weights().iter().all(|&w| (-1e-9..=1.0 + 1e-9).contains(&w)));
    }
}

#[test]
fn a_panel_that_overlaps_itself_gives_the_lowest_triangle_too() {
    let mut random = Random(4);
    let (below, above) = (grid(6, 8.0, 0.3, &mut random), grid(6, 8.0, 0.3, &mut random));
    // The second layer lies over the first and hangs together with it at one vertex.
    let joint = below.uv.len() as u32 - 1;
    let offset = joint + 1;
    let mut uv = below.uv.clone();
    uv.extend(above.uv.iter().map(|p| *p + DVec2::splat(4.0)));
    let lifted =
        above.triangles.iter().map(|t| t.map(|v| if v == offset - 1 { joint } else { v + offset }));
    let triangles =
        below.triangles.iter().copied().chain(lifted.filter(|t| !t.contains(&joint))).collect();
    let panel = panel(uv, triangles);
    let points = points(&panel, 52.0, 2000, &mut random);
    assert_eq!(differences(&panel, &points), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_grid_and_any_order_of_points_agree_with_brute_force(seed in 0u64..1 << 40, across in 1u32..12, jitter in 0.0..0.9f64) {
        let mut random = Random(seed);
        let panel = grid(across, 5.0, jitter, &mut random);
        // Jitter over a half may turn triangles over; those are not a panel's (a reader takes them
        // out).
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| panel.uv[v as usize]);
            (b - a).perp_dot(c - a)
        };
        prop_assume!(panel.triangles.iter().all(|t| area(t) > 0.0));
        let points = points(&panel, 5.0 * f64::from(across), 60, &mut random);
        prop_assert_eq!(differences(&panel, &points), 0);
    }
}

#[test]
fn many_threads_that_begin_at_once_never_wait_for_each_other() {
    let panel = grid(300, 1.0, 0.0, &mut Random(9));
    // Every fourth row ends on the border, where only a search can tell.
    let row = |y: u32| -> Vec<DVec3> {
        let inside = (0..2000).map(|x| DVec3::new(1.5 + f64::from(x % 290), f64::from(y), 0.0));
        let border = y.is_multiple_of(4).then_some(DVec3::new(f64::from(y), 0.0, 0.0));
        inside.chain(border).collect()
    };
    let (sender, counts) = mpsc::channel();
    // Threads that wait for ever can't be joined: they end with the tests.
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(64).build().unwrap();
        for _ in 0..4 {
            let locator = Locator::new(&panel);
            let found = |y| locator.locate(&row(y)).into_iter().flatten().count();
            sender.send(pool.install(|| (0..256).into_par_iter().map(found).sum::<usize>()))?;
        }
        Ok::<(), mpsc::SendError<usize>>(())
    });
    for _ in 0..4 {
        let found = counts.recv_timeout(Duration::from_secs(300)).expect("threads wait for ever");
        assert_eq!(found, 256 * 2000 + 64);
    }
}
