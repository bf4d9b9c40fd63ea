#![allow(unused, missing_docs)]
use std::path::Path;
use image::RgbImage;
use warpknit_core::fabric::Fabric;
use warpknit_photo::recognise::{ClothKey, Face, RecogniseSettings, Ranked, recognise};
fn key(f: &Fabric) -> ClothKey {
    let Some(_) = f.warp_knit() else { return key(&Fabric::named(match f.name.as_str() { "jersey" => "tulle-5", "rib-1x1" => "hex-net-5", "rib-2x2" => "pinstripe", "garter" => "hex-net-3", _ => "ticking" }).unwrap()) };
    ClothKey::new(f.warp_knit().unwrap(), f.repeat(), f.threading_repeat())
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let levels: Vec<&str> = args[2].split(',').collect();
    let only: Vec<&str> = args.get(3).map(|s| s.split(',').collect()).unwrap_or_default();
    let dir = format!("/work/tmp-recognise/{}", args[1]);
    let mut names: Vec<String> = std::fs::read_dir(&dir).unwrap().filter_map(|e| e.unwrap().file_name().into_string().ok()).filter_map(|n| n.strip_suffix(".toml").map(str::to_owned)).collect();
    names.sort();
    for lname in levels {
        let mut counts = [[[0usize; 2]; 3]; 2];
        let mut n = 0;
        let mut secs = 0.0;
        for name in &names {
            if !only.is_empty() && !only.contains(&name.as_str()) { continue; }
            let f = Fabric::parse(&std::fs::read_to_string(format!("{dir}/{name}.toml")).unwrap()).unwrap();
            let Ok(front) = image::open(format!("{dir}/{name}.{lname}.Front.png")) else { continue };
            let Ok(back) = image::open(format!("{dir}/{name}.{lname}.Back.png")) else { continue };
            let (front, back) = (front.to_rgb8(), back.to_rgb8());
            n += 1;
            let mut line = format!("{lname} {name:20}");
            for (which, photos) in [vec![(&back, Face::Back)], vec![(&front, Face::Front)], vec![(&back, Face::Back), (&front, Face::Front)]].into_iter().enumerate() {
                if which < 2 && std::env::var("BOTH").is_ok() { continue; }
                let t = std::time::Instant::now();
                let r = recognise(&photos, &RecogniseSettings::default());
                let (r, fabric) = match r { Ok(r) => (r.ranked, Some(r.fabric)), Err(e) => { line += &e.to_string()[..10]; (vec![], None) } };
                if let (Some(x), true) = (&fabric, which == 2) { if let Some(a) = r.first() { if a.fabric.warp_knit().is_some() && key(x) != key(&a.fabric) { line += " MIRRORKEY"; } } }
                let both: [Vec<Ranked>; 2] = [vec![], r];
                secs += t.elapsed().as_secs_f64();
                for (stage, r) in both.iter().enumerate() {
                    let place = r.iter().position(|c| key(&c.fabric) == key(&f)).unwrap_or(98);
                    counts[stage][which][0] += usize::from(place == 0);
                    counts[stage][which][1] += usize::from(place < 3);
                    if stage == 0 { line += &format!(" | {}>", place + 1); continue; }
                    line += &format!("{} ", place + 1);
                    if which == 2 { line += &format!("{:.3} {:.2}", r.get(place).map_or(0.0, |c| c.explained), r.get(place).map_or(0.0, |c| c.explained_of_common)); for c in r.iter().take(2) { line += &format!(" {}{} {:.3} {:.2}", if c.is_mirrored {"~"} else {""}, c.fabric.name, c.explained, c.explained_of_common); } }
                }
            }
            println!("{line}");
        }
        println!("{lname} n {n}: drafts: back {:?} front {:?} both {:?}; refined: back {:?} front {:?} both {:?} {:.2} s each", counts[0][0], counts[0][1], counts[0][2], counts[1][0], counts[1][1], counts[1][2], secs / 3.0 / n as f64);
    }
}
