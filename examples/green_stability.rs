use cager_proto::container::ContainerReader;
fn main() {
    for path in std::env::args().skip(1) {
        let mut c = ContainerReader::open(std::io::BufReader::new(std::fs::File::open(&path).unwrap())).unwrap();
        let v = c.header().cage_vertices as usize;
        let rest = c.rest().unwrap();
        let diag = cager_core::mesh::diagonal(&rest.points);
        let n = c.frames();
        let mut cages: Vec<Vec<f32>> = vec![];
        for t in 0..n {
            let mut out = Vec::new();
            c.read_frame(t, &mut out).unwrap();
            cages.push(out);
        }
        let (mut sum, mut max, mut count) = (0.0, 0.0f64, 0usize);
        for t in 1..n - 1 {
            for j in 0..v {
                let d: f64 = (0..3)
                    .map(|k| {
                        let x = |u: usize| f64::from(cages[u][3 * j + k]);
                        (x(t + 1) - 2.0 * x(t) + x(t - 1)).powi(2)
                    })
                    .sum::<f64>()
                    .sqrt()
                    / diag;
                sum += d;
                count += 1;
                max = max.max(d);
            }
        }
        println!("stab mean {:.3} max {:.3}", 100.0 * sum / count as f64, 100.0 * max);
    }
}
