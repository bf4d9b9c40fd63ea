#![allow(unused, missing_docs)]
#[path = "../tests/it/cloth.rs"]
mod cloth;
#[path = "../tests/it/knit_photo.rs"]
mod knit_photo;
use std::path::Path;
use image::RgbImage;
use warpknit::fabric::{Fabric, builtin};
use warpknit::photo::recognise::{Face, grid};
use knit_photo::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let base: u64 = args[2].parse().unwrap();
    let out = format!("/work/tmp-recognise/{}{base}", args[1]);
    std::fs::create_dir_all(&out).unwrap();
    let fabrics: Vec<(String, Fabric)> = match args[1].as_str() {
        "cat" => builtin::names().map(|n| (n.to_string(), Fabric::named(n).unwrap())).filter(|f| f.1.warp_knit().is_some()).collect(),
        "weft" => builtin::names().map(|n| (n.to_string(), Fabric::named(n).unwrap())).filter(|f| f.1.weft_knit().is_some()).collect(),
        "rand" => random(base),
        _ => grid().map(|f| (f.name.replace("//", "").replace('/', "_").replace(' ', ""), f)).collect(),
    };
    for (at, (name, f)) in fabrics.iter().enumerate() {
        let seed = base + at as u64;
        std::fs::write(format!("{out}/{name}.toml"), f.to_string()).unwrap();
        let v = varied(f, seed);
        for face in [Face::Front, Face::Back] {
            if Path::new(&format!("{out}/{name}.hard.{face:?}.png")).exists() { continue; }
            let old = format!("/work/tmp-recognise/p/{name}.{face:?}.{seed}.png");
            let d = if Path::new(&old).exists() { image::open(&old).unwrap().to_rgb8() } else { drawn(&v, face, seed) };
            for (lname, level) in [("fair", FAIR), ("hard", HARD)] {
                taken(&d, level, seed + if face == Face::Back { 5000 } else { 0 }).save(format!("{out}/{name}.{lname}.{face:?}.png")).unwrap();
            }
        }
    }
}
fn random(base: u64) -> Vec<(String, Fabric)> {
    let mut r = cloth::Random::new(base);
    let mut known: Vec<_> = builtin::names().map(|n| Fabric::named(n).unwrap()).filter(|f| f.warp_knit().is_some()).chain(grid()).map(|f| key(&f)).collect();
    let mut all = Vec::new();
    while all.len() < 40 {
        let courses = [2, 2, 3, 4][cloth::whole(r.within(0.0, 3.999)) as usize];
        let chain = |r: &mut cloth::Random| {
            let mut laps = Vec::new();
            for _ in 0..courses {
                let needle = cloth::whole(r.within(0.0, 3.999));
                laps.push(if r.within(0.0, 1.0) < 0.5 { (needle, needle + 1) } else { (needle + 1, needle) });
            }
            let low = laps.iter().map(|l| l.0.min(l.1)).min().unwrap();
            laps.iter().map(|l| format!("{}-{}", l.0 - low, l.1 - low)).collect::<Vec<_>>().join("/")
        };
        let chains = [chain(&mut r), chain(&mut r)];
        let f = Fabric::named("locknit").unwrap().with_chains(&chains, &[]).unwrap();
        let k = key(&f);
        if known.contains(&k) { continue; }
        known.push(k);
        all.push((chains.join("+").replace('/', "_"), f));
    }
    all
}
fn key(f: &Fabric) -> warpknit::photo::recognise::ClothKey {
    warpknit::photo::recognise::ClothKey::new(f.warp_knit().unwrap(), f.repeat(), f.threading_repeat())
}
