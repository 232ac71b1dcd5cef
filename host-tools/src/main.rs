use selvedge_tools::*;
fn main(){
  for name in ["carpet07","felt05"] {
    let m=sparsebtf::read_material(std::path::Path::new("/work/shared/data/sparsebtf"),name,None).unwrap();
    for bits in [8,9,10,11] {
    let b=write::write_material(&m.to_model(bits).unwrap());
    let t=std::time::Instant::now();
    let s=selvedge::open(&b,&selvedge::Limits::default());
    println!("{name} bits {bits} {} bytes {:?}", b.len(), t.elapsed());
    match s { Ok(s)=>{ println!("{:?}", s.header().operations);
      for (x,y,l,v) in [(13,391,5,9),(110,301,42,110),(207,211,79,60)] {
        let p=s.point_values(x,y,l,v); let f=|q:i32| q as f64/1048576.0*std::f64::consts::LN_2;
        println!("{} {} | {} {}", f(p.c1),f(p.c2), m.value(1,x as usize,y as usize,l as usize,v as usize), m.value(2,x as usize,y as usize,l as usize,v as usize));
      }
      if bits==10 {for q in s.sections(){println!("{:x} {} {}",q.kind,q.instance,q.length);}}
      }, Err(e)=>println!("{e}") }
    }
  }
}
