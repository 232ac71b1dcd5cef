use selvedge_tools::*;
fn main(){
  let mut bad=0;
  let mut files=vec![];
  for seed in 0..300u64 {
    let m=extreme::extreme_model(seed);
    let b=write::write_material(&m);
    let mut n=0;
    let ok=selvedge::validate(&b,None,&selvedge::Limits::NONE,&mut |f:selvedge::Finding|{ if n<3 {println!("{seed}: {f}");} n+=1; true});
    if !ok {bad+=1;}
    let (a,d)=write::write_split(&m);
    if m.channels.iter().any(|c|c.ensemble.is_some()) { if let Err(e)=selvedge::open_with(&a,Some(&d),&selvedge::Limits::NONE) {println!("{seed} split {e}");}
     if !selvedge::validate(&d,None,&selvedge::Limits::NONE,&mut |f:selvedge::Finding|{println!("{seed} dict {f}"); true}){bad+=1;} }
    files.push(b);
  }
  println!("bad {bad}, bytes {}", files.iter().map(Vec::len).sum::<usize>());
  let g=gpu::Gpu::new(wgpu::Backends::VULKAN).unwrap().unwrap();
  println!("{}",g.description);
  let mut mats=vec![];
  for f in &files { mats.push(selvedge::open(f,&selvedge::Limits::NONE).unwrap()); }
  let loaded=g.load(&mats);
  let mut r=random::Random::new(1);
  for entry in ["point","filtered","trilinear","floats"] {
  let q:Vec<gpu::Query>=(0..300_000).map(|i|{ let mut w=||r.word() as i32; let mut d=||[(w()>>16) as u32,(w()>>16) as u32,(w()>>16) as u32]; let l=d(); let v=d();
     gpu::Query{material:(i%300) as u32,u:r.word(),v:r.word(),level_q16:r.word()>>14,light:l,view:v}}).collect();
  let t=std::time::Instant::now();
  let a=g.answer(&loaded,entry,&q).unwrap();
  let tg=t.elapsed(); let t=std::time::Instant::now();
  let c:Vec<_>=q.iter().map(|q|gpu::answer_on_cpu(&mats[q.material as usize],entry,q)).collect();
  println!("{entry} gpu {tg:?} cpu {:?} differ {}", t.elapsed(), a.iter().zip(&c).filter(|(a,b)|a!=b).count());
  }
}
