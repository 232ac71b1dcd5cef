use selvedge_tools::*;
fn main(){
  let g=gpu::Gpu::new(wgpu::Backends::VULKAN).unwrap().unwrap();
  let m=sparsebtf::read_material(std::path::Path::new("/work/shared/data/sparsebtf"),"carpet07",None).unwrap();
  let b=write::write_material(&m.to_model(10).unwrap());
  let mats=vec![selvedge::open(&b,&selvedge::Limits::NONE).unwrap()];
  let loaded=g.load(&mats);
  let mut r=random::Random::new(1);
  for entry in ["point","filtered","trilinear","floats"] {
  for n in [64usize, 200_000] {
  let q:Vec<gpu::Query>=(0..n).map(|i|{ let mut w=||r.word() as i32; let mut d=||[(w()>>17) as u32,(w()>>17) as u32,(w()>>16) as u32]; let l=d(); let v=d();
     gpu::Query{material:0,u:r.word(),v:r.word(),level_q16:r.word()>>14,light:l,view:v}}).collect();
  let t=std::time::Instant::now();
  let a=g.answer(&loaded,entry,&q).unwrap();
  let tg=t.elapsed(); let t=std::time::Instant::now();
  let c:Vec<_>=q.iter().map(|q|gpu::answer_on_cpu(&mats[q.material as usize],entry,q)).collect();
  println!("{entry} {n} gpu {tg:?} cpu {:?} differ {}", t.elapsed(), a.iter().zip(&c).filter(|(a,b)|a!=b).count());
  }}
}
