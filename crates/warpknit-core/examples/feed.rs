use warpknit_core::{
    fabric::Fabric,
    knit::{Pattern, clearance, links, numbers, run_in},
};
fn main() {
    for (name, bar, ks) in [
        ("locknit", 0, [0.5, 0.7, 0.8, 0.9, 1.1, 1.2, 1.4, 2.0]),
        ("locknit", 1, [0.5, 0.7, 0.8, 0.9, 1.1, 1.2, 1.4, 2.0]),
        ("marquisette", 0, [0.5, 0.7, 0.8, 0.9, 1.1, 1.2, 1.4, 2.0]),
        ("hex-net-3", 0, [0.4, 0.5, 0.6, 0.7, 0.8, 1.2, 1.4, 2.0]),
    ] {
        let f0 = Fabric::named(name).unwrap();
        let base = numbers::measure(&f0, &Pattern::new(&f0)).run_in[bar].unwrap();
        for k in ks {
            let mut f = f0.clone();
            let text = f.to_string();
            let mut parts: Vec<String> = text.split("[[bars]]").map(String::from).collect();
            parts[bar + 1] = format!("\nrun_in_mm = {:.1}{}", base * k, parts[bar + 1]);
            f = Fabric::parse(&parts.join("[[bars]]")).unwrap();
            let t = std::time::Instant::now();
            let p = Pattern::new(&f);
            let ms = t.elapsed().as_secs_f64() * 1e3;
            let l = links::measure(&f, &p);
            println!(
                "{name} {bar} {k} wanted {:.0} got {:.0} links {}/{} clear {:.3} {:.0} ms {:?} -> {}",
                base * k,
                numbers::measure(&f, &p).run_in[bar].unwrap(),
                l.wrong,
                l.checked,
                clearance::measure(&f, &p, f.radius()).min_over_2r,
                ms,
                p.relaxation().map(|r| (r.sweeps, r.grown)),
                run_in::check(&f, &p).err().map_or("ok".into(), |e| e.to_string())
            );
        }
    }
}
