use glam::DVec3;
use warpknit_core::{
    fabric::Fabric,
    knit::{Pattern, clearance, links, numbers},
};
fn curv(p: &[DVec3], r: f64) -> (f64, usize, f64) {
    let mut worst = (9.0, 0, 0.0);
    for i in 1..p.len() - 2 {
        let s = warpknit_core::yarn::curve::span(p, i);
        let q: Vec<_> = (0..=24).map(|k| s.at(k as f64 / 24.0)).collect();
        for w in q.windows(3) {
            let (u, v) = (w[1] - w[0], w[2] - w[1]);
            let c =
                2.0 * u.cross(v).length() / (u.length() * v.length() * (u + v).length()).max(1e-30);
            if 1.0 / c / r < worst.0 {
                worst = (1.0 / c / r, i, 0.0);
            }
        }
    }
    worst
}
fn main() {
    let mut args = std::env::args().skip(1);
    let file = args.next().unwrap();
    let only: Vec<String> = args.collect();
    let (mut n, mut badl, mut tot) = (0, 0, 0);
    for line in std::fs::read_to_string(file).unwrap().lines() {
        let p: Vec<_> = line.split('|').collect();
        if line.contains("...") || p.len() < 1 || p[0].is_empty() {
            continue;
        }
        if !only.is_empty() && !only.iter().any(|o| o == p[0]) {
            continue;
        }
        let mut f = if p.len() == 1 {
            Fabric::named(p[0]).unwrap()
        } else {
            Fabric::named("tricot").unwrap()
        };
        if p.len() > 1 {
            let (mut ch, mut th) = (vec![], vec![]);
            for x in &p[1..] {
                let (a, b) = x.split_once('@').unwrap_or((x, "I"));
                ch.push(a.to_string());
                th.push(b.to_string());
            }
            f = match f.with_chains(&ch, &th) {
                Ok(f) => f,
                Err(e) => {
                    println!("{line}: {e}");
                    continue;
                }
            };
        }
        let t = std::time::Instant::now();
        let pat = Pattern::new(&f);
        let ms = t.elapsed().as_secs_f64() * 1e3;
        let l = links::measure(&f, &pat);
        let ms2 = t.elapsed().as_secs_f64() * 1e3 - ms;
        let c = clearance::measure(&f, &pat, f.radius());
        let nums = numbers::measure(&f, &pat);
        let mesh = warpknit_core::knit::mesh::StructureMesh::anchored_at(&f, glam::DVec2::ZERO);
        let mut k = (9.0, String::new());
        let th = f.thickness();
        for bar in 0..f.yarn_systems() {
            for g in 0..f.threading_repeat().max(if pat.runs_across(bar) { f.repeat() } else { 0 })
                as i64
            {
                let mut kn = warpknit_core::knit::Knitted::default();
                let steps =
                    if pat.runs_across(bar) { f.threading_repeat() } else { f.repeat() } as i64;
                pat.lay(bar, g, 0..3 * steps.max(2), &mesh, &mut kn);
                if kn.points.len() < 12 {
                    continue;
                }
                let n = kn.points.len();
                let (a, b) = (n / 4, n * 3 / 4);
                let (w, i, _) = curv(&kn.points[a..b], f.radius() * th[bar]);
                if w < k.0 {
                    let t = &kn.tags[a + i];
                    k = (w, format!("bar {} {:?}{} c{}", bar + 1, t.kind, t.point, t.course));
                }
            }
        }
        n += 1;
        if l.wrong > 0 {
            badl += 1;
        }
        tot += l.checked;
        println!(
            "{:44.44} laps {:4} {:7.1} ms +{:.1} links {}/{} clear {:.3} curv {:.2} {} thick/d {:.2} mass {:.0} runin {:?} {:?}",
            line,
            f.threading_repeat() * f.repeat() * f.yarn_systems(),
            ms,
            ms2,
            l.wrong,
            l.checked,
            c.min_over_2r,
            k.0,
            k.1,
            nums.thickness / 2.0 / f.radius(),
            nums.mass,
            nums.run_in.iter().map(|x| x.map(|x| x.round())).collect::<Vec<_>>(),
            pat.relaxation().map(|r| (
                r.sweeps,
                (r.stretch * 1e3).round() / 1e3,
                (r.grown * 1e3).round() / 1e3
            ))
        );
    }
    println!("{n} fabrics, {badl} with wrong links, {tot} links");
}
