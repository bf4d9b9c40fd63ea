#![allow(unused, missing_docs)]
#[path = "../tests/it/cloth.rs"]
mod cloth;
#[path = "../tests/it/knit_photo.rs"]
mod knit_photo;
use std::path::Path;
use image::RgbImage;
use warpknit::fabric::{Fabric, builtin};
use warpknit::photo::recognise::{ClothKey, Face, grid, rank};
use knit_photo::*;

fn key(f: &Fabric) -> ClothKey {
    ClothKey::new(f.warp_knit().unwrap(), f.repeat(), f.threading_repeat())
}
fn cached(f: &Fabric, name: &str, face: Face, seed: u64) -> RgbImage {
    let p = format!("/work/tmp-recognise/p/{name}.{face:?}.{seed}.png");
    if !Path::new(&p).exists() {
        std::fs::create_dir_all("/work/tmp-recognise/p").unwrap();
        drawn(&varied(f, seed), face, seed).save(&p).unwrap();
    }
    image::open(&p).unwrap().to_rgb8()
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let set = args[1].as_str();
    let base: u64 = args[2].parse().unwrap();
    let only: Vec<&str> = args.get(3).map(|s| s.split(',').collect()).unwrap_or_default();
    let fabrics: Vec<(String, Fabric)> = match set {
        "cat" => builtin::names().map(|n| (n.to_string(), Fabric::named(n).unwrap())).filter(|f| f.1.warp_knit().is_some()).collect(),
        _ => grid().map(|f| (f.name.replace("//", "").replace('/', "_").replace(' ', ""), f)).collect(),
    };
    let t = std::time::Instant::now();
    let _ = rank(&[(&RgbImage::new(64, 64), Face::Back)]);
    println!("catalogue {:.2}s", t.elapsed().as_secs_f64());
    for (lname, level) in [("fair", FAIR), ("hard", HARD)] {
        let mut counts = [[0usize; 2]; 3];
        let mut n = 0;
        let mut secs = 0.0;
        for (at, (name, f)) in fabrics.iter().enumerate() {
            if !only.is_empty() && !only.contains(&name.as_str()) { continue; }
            n += 1;
            let seed = base + at as u64;
            let front = taken(&cached(f, name, Face::Front, seed), level, seed);
            let back = taken(&cached(f, name, Face::Back, seed), level, seed + 5000);
            if !only.is_empty() { front.save(format!("/work/tmp-recognise/{name}.{lname}.front.png")).unwrap(); back.save(format!("/work/tmp-recognise/{name}.{lname}.back.png")).unwrap(); }
            let mut line = format!("{lname} {name:24}");
            for (which, photos) in [vec![(&back, Face::Back)], vec![(&front, Face::Front)], vec![(&back, Face::Back), (&front, Face::Front)]].into_iter().enumerate() {
                let t = std::time::Instant::now();
                let r = rank(&photos);
                secs += t.elapsed().as_secs_f64();
                let place = r.iter().position(|c| key(&c.fabric) == key(f)).unwrap_or(999);
                counts[which][0] += usize::from(place == 0);
                counts[which][1] += usize::from(place < 3);
                line += &format!(" | {} {:.2} of {} {:.2}", place + 1, r.get(place).map_or(0.0, |c| c.explained), r[0].fabric.name, r[0].explained);
            }
            println!("{line}");
        }
        println!("{lname} n {n}: back {:?} front {:?} both {:?}, {:.2} s each", counts[0], counts[1], counts[2], secs / 3.0 / n as f64);
    }
}
