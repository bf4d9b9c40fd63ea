use warpknit::render::*; use warpknit::{drape::picture, fabric::Fabric};
fn main(){
 let a: Vec<String>=std::env::args().collect();
 let (w,c,size):(u32,u32,u32)=(a[1].parse().unwrap(),a[2].parse().unwrap(),a[3].parse().unwrap());
 let mut scene=picture::swatch(&Fabric::named(&a[4]).unwrap(),w,c);
 let _=&mut scene;
 let view = if a[5]=="back" {View::Back} else if a[5]=="iso" {View::Iso} else {View::Front};
 let o=Options{width:size,height:size,lod:a[6]=="lod",..Options::default()};
 let o=Options{st:a.get(7).map_or(10,|x|x.parse().unwrap()),sr:a.get(8).map_or(6,|x|x.parse().unwrap()),..o};
 let camera=Camera::view(view,&scene.positions,Camera::DEFAULT_FOV,1.0,o.aspect());
 let t=std::time::Instant::now();
 let gpu=gpu::Gpu::find(true).unwrap(); println!("{} {:?}",gpu.name(),t.elapsed());
 let mut r=gpu::Renderer::new(gpu,o.samples).unwrap(); println!("pipelines {:?}",t.elapsed());
 let y=r.load(&scene,o.st).unwrap(); println!("load {:?}",t.elapsed());
 let p=r.draw(&y,&camera,&o).unwrap(); println!("draw {:?}",t.elapsed());
 let t=std::time::Instant::now(); let _=r.draw(&y,&camera,&o).unwrap(); println!("again {:?}",t.elapsed());
 p.save("/tmp/gpu.png").unwrap();
 let t=std::time::Instant::now();
 if a.last().unwrap()=="cpu" { let q=render(&scene,&camera,&o,&|_|()); println!("cpu {:?}",t.elapsed()); q.save("/tmp/cpu.png").unwrap(); }
}
