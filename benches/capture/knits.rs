//! How many knits are recognised in drawn photos: the catalogue, two-bar cloths, random lappings and
//! weft knits, each as a fair photo, as a hard one, and on light paper, and how many of the answers that
//! need no warning are right.
//!
//! In: seeds that nothing was tuned on. Out: a table of docs/capture.md, and on stderr what was taken
//! for what. `cargo bench --bench capture -- knits 'two bars' fair` has some rows alone.

use std::time::Instant;

use warpknit::fabric::lapping::Chain;
use warpknit::fabric::{Bar, Fabric, builtin};
use warpknit::photo::recognise::{
    ClothKey, Face, RecogniseError, RecogniseSettings, Recognition, grid, recognise,
};

use super::cloth::{Random, whole};
use super::is_wanted;
use super::knit_photo::{FAIR, ON_PAPER, Taking, taken, varied};

/// Seeds from 100 on, from 20 000 on and from 41 000 on were for tuning.
const FIRST_SEED: u64 = 30_000;
const RANDOM: usize = 40;
/// As bad as a photo may be.
const HARD: Taking = Taking { blur: 1.8, noise: 0.1, bend: 1.5, light: 0.5, ..FAIR };
/// Of yarns that lie as flat as their neighbours leave room.
const SPREAD: Taking = Taking { is_spread: true, ..FAIR };
const LEVELS: [(&str, Taking); 4] =
    [("fair", FAIR), ("hard", HARD), ("on paper", ON_PAPER), ("spread", SPREAD)];

/// The table of knits.
pub(crate) fn knits() {
    println!("\n| knits | photos | right | among three | sure | right of these | seconds |");
    println!("|---|---|---|---|---|---|---|");
    let built_in = |is_warp: bool| {
        let all = builtin::names().map(|name| Fabric::named(name).unwrap());
        all.filter(move |fabric| fabric.name != "cable" && fabric.warp_knit().is_some() == is_warp)
    };
    let sets: [(&str, Vec<Fabric>); 4] = [
        ("catalogue", built_in(true).collect()),
        ("two bars", grid().collect()),
        ("random", random(FIRST_SEED)),
        ("weft knits", built_in(false).collect()),
    ];
    let names = sets.each_ref().map(|(name, _)| *name);
    for (name, fabrics) in sets.iter().filter(|(name, _)| is_wanted(name, &names)) {
        for (level, taking) in LEVELS {
            if !is_wanted(level, &LEVELS.map(|(level, _)| level)) {
                continue;
            }
            row(
                &format!("{name} | {level}, both faces"),
                fabrics,
                taking,
                &[Face::Back, Face::Front],
            );
            if fabrics[0].warp_knit().is_some() {
                row(&format!("{name} | {level}, back"), fabrics, taking, &[Face::Back]);
            }
        }
    }
}

/// A row of the table: how many fabrics are recognised in photos of some faces.
fn row(heading: &str, fabrics: &[Fabric], taking: Taking, faces: &[Face]) {
    let (mut first, mut third, mut sure, mut sure_first) = (0, 0, 0, 0);
    let begun = Instant::now();
    for (seed, fabric) in (FIRST_SEED..).zip(fabrics) {
        let own = varied(fabric, seed);
        let photos: Vec<_> =
            faces.iter().map(|face| (taken(&own, *face, taking, seed), *face)).collect();
        let photos: Vec<_> = photos.iter().map(|(photo, face)| (photo, *face)).collect();
        let found = recognise(&photos, &RecogniseSettings::default());
        let place = found.as_ref().ok().and_then(|found| place(found, fabric));
        if place != Some(0) {
            eprintln!("{heading}, seed {seed}: {} is {}", named(fabric), answer(&found));
        }
        first += usize::from(place == Some(0));
        third += usize::from(place.is_some());
        let is_sure = found.as_ref().is_ok_and(Recognition::is_sure);
        sure += usize::from(is_sure);
        sure_first += usize::from(is_sure && place == Some(0));
    }
    println!(
        "| {heading} | {first} of {} | {third} | {sure} | {sure_first} | {:.1} |",
        fabrics.len(),
        begun.elapsed().as_secs_f64() / fabrics.len() as f64
    );
}

/// The cloths that were found instead, with what each explains.
fn answer(found: &Result<Recognition, RecogniseError>) -> String {
    match found {
        Ok(found) => {
            let ranked = found.ranked.iter().map(|ranked| {
                let mirrored = if ranked.is_mirrored { " mirrored" } else { "" };
                format!("{}{mirrored} {:.4}", named(&ranked.fabric), ranked.explained)
            });
            ranked.collect::<Vec<_>>().join(", ")
        }
        Err(error) => error.to_string(),
    }
}

/// A fabric's name and its chains.
fn named(fabric: &Fabric) -> String {
    let chains = fabric.warp_knit().map_or_else(Vec::new, |knit| {
        knit.bars.iter().filter_map(Bar::chain).map(Chain::to_string).collect()
    });
    format!("{} ({})", fabric.name, chains.join(" + "))
}

/// The place of a fabric among the three that were found.
fn place(found: &Recognition, fabric: &Fabric) -> Option<usize> {
    found.ranked.iter().position(|ranked| match (key(&ranked.fabric), key(fabric)) {
        (Some(one), Some(other)) => one == other,
        (None, None) => ranked.fabric.name == fabric.name,
        _ => false,
    })
}

fn key(fabric: &Fabric) -> Option<ClothKey> {
    let knit = fabric.warp_knit()?;
    Some(ClothKey::new(knit, fabric.repeat(), fabric.threading_repeat()))
}

/// Lappings of two full bars and of two to four courses that are in no catalogue.
fn random(seed: u64) -> Vec<Fabric> {
    let mut random = Random::new(seed);
    let built_in = builtin::names().map(|name| Fabric::named(name).unwrap());
    let mut known: Vec<ClothKey> =
        built_in.chain(grid()).filter_map(|fabric| key(&fabric)).collect();
    let mut found = Vec::new();
    while found.len() < RANDOM {
        let courses = [2, 2, 3, 4][usize::try_from(whole(random.within(0.0, 3.999))).unwrap()];
        let chains = [(); 2].map(|()| chain(&mut random, courses));
        let fabric = Fabric::named("locknit").unwrap().with_chains(&chains, &[]).unwrap();
        let key = key(&fabric).unwrap();
        if !known.contains(&key) {
            known.push(key);
            found.push(fabric);
        }
    }
    found
}

/// A chain over up to four needles.
fn chain(random: &mut Random, courses: usize) -> String {
    let laps: Vec<[i64; 2]> = (0..courses)
        .map(|_| {
            let needle = whole(random.within(0.0, 3.999));
            if random.within(0.0, 1.0) < 0.5 { [needle, needle + 1] } else { [needle + 1, needle] }
        })
        .collect();
    let low = laps.iter().flatten().copied().min().unwrap();
    laps.iter()
        .map(|[from, to]| format!("{}-{}", from - low, to - low))
        .collect::<Vec<_>>()
        .join("/")
}
