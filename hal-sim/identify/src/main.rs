//! dev
use identify::{channel::Channel, design::*, noise::Noise, select::*, record::*, hypothesis::*};
use plant::model::Model;
use plant::recording::Recording;
fn main() {
    let args: Vec<usize> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    for i in if args.is_empty() { (1..=10).collect() } else { args } {
        let dir = std::path::PathBuf::from(format!("../shared/recordings/open-{i:02}"));
        let model = Model::load(&dir.join("model.toml")).unwrap();
        let rec = Recording::load(&dir.join("fit.csv.gz")).unwrap();
        let t1 = std::time::Instant::now();
        let r = Record::new(&rec, &model);
        println!("== {i} signals {:?}", t1.elapsed());
        let b = r.balance(&model);
        println!("== {i} rounding {:?} {:?}", b.rounding, t1.elapsed());
        let base = Base::new(&b);
        println!("== {i} base {:?}", t1.elapsed());
        let mut found: Vec<Hypothesis> = vec![];
        for stage in 0..3 {
            let mut noise = Noise::declared(&model, &r.signals, &r.fourier);
            for pass in 0..2 {
                let w = Whitener::new(&r.signals, &r.fourier, &noise);
                let mut search = Search::new(&b, &w, base.normal(&w));
                for h in &found { search.add(h); }
                let sol = search.normal.solve(None);
                if pass == 0 { if stage>0 {println!("   pass0 values {:?}", sol.values.iter().skip(base.parameters.len()).collect::<Vec<_>>());} noise = noise.corrected(&search.normal.residual(&sol.values).parts, &r.fourier); continue; }
                let left = search.normal.residual(&sol.values);
                for c in Channel::ALL { let x = left.parts[c.index()].as_ref().unwrap(); let u = w.mask(c).iter().filter(|o| **o).count() as f64; print!(" {}:{:.3}", c.name(), (dot(x, x) / u).sqrt()); }
                println!();
                for (k, (p, _)) in base.parameters.iter().enumerate() { print!("{p:?} {:.4}; ", sol.values[k]); } println!();
                println!("   values {:?}", sol.values.iter().skip(base.parameters.len()).collect::<Vec<_>>());
                let trials = search.trials(&sol);
                println!("stage {stage} cost {:.0} {:?}", search.normal.cost(&sol.values), t1.elapsed());
                for t in trials.iter().take(6) {
                    println!("   {:?} {:?} {:.4} fall {:.0} values {:?}", t.hypothesis.family, t.hypothesis.place, t.hypothesis.shape, t.gain.fall, t.gain.values);
                }
                let best = search.refined(trials[0].clone(), &sol);
                println!("   -> {:?} {:.5} fall {:.0} {:?}", best.hypothesis, best.hypothesis.shape, best.gain.fall, best.gain.values);
                found.push(best.hypothesis);
                let n = search.normal.len();
                search.add(&best.hypothesis);
                println!("   cv {:?} {:?}", search.normal.held_back(n).iter().map(|x| x.round()).collect::<Vec<_>>(), t1.elapsed());
            }
        }
    }
}
