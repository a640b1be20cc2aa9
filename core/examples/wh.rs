use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Harmonic};
use cager_core::mesh::TriMesh;
fn main() {
    for name in std::env::args().skip(1) {
        let b = std::fs::read(&name).unwrap();
        let u = |k: usize| u64::from_le_bytes(b[8 * k..8 * k + 8].try_into().unwrap()) as usize;
        let (n, v, f) = (u(0), u(1), u(2));
        let d = |k: usize| f64::from_bits(u(3 + k) as u64);
        let pts = (0..n).map(|i| [d(3 * i), d(3 * i + 1), d(3 * i + 2)]).collect::<Vec<_>>();
        let vs = (n..n + v).map(|i| [d(3 * i), d(3 * i + 1), d(3 * i + 2)]).collect::<Vec<_>>();
        let ts = (0..f).map(|i| [0, 1, 2].map(|k| u(3 + 3 * (n + v) + 3 * i + k) as u32)).collect();
        let cage = Cage::new(TriMesh { vertices: vs, triangles: ts }).unwrap();
        let clock = std::time::Instant::now();
        let found = Harmonic.coordinates(&cage, &pts);
        match found {
            Ok(found) => {
                let t = clock.elapsed().as_secs_f64();
                let plan = found.plan.clone().unwrap();
                std::fs::write(format!("{name}.plan"), plan.as_bytes()).unwrap();
                let clock = std::time::Instant::now();
                let again = Harmonic.coordinates_by_plan(&cage, &pts, &plan).unwrap();
                let t2 = clock.elapsed().as_secs_f64();
                let mut worst = 0f64;
                for j in 0..v {
                    for i in 0..n {
                        worst = worst.max((found.phi[(i, j)] - again.phi[(i, j)]).abs());
                    }
                }
                println!(
                    "  by plan {t2:.2} s, {} bytes, differs by {worst:e}; header {:?}",
                    plan.as_bytes().len(),
                    &plan.as_bytes()[..3]
                );
                if let Ok(old) = std::fs::read(format!("{name}.base.phi")) {
                    let mut worst = 0f64;
                    for j in 0..v {
                        for i in 0..n {
                            let k = 8 * (j * n + i);
                            worst = worst
                                .max((found.phi[(i, j)] - f64::from_le_bytes(old[k..k + 8].try_into().unwrap())).abs());
                        }
                    }
                    println!("  differs from before by {worst:e}");
                }
                let mut bytes = Vec::new();
                for j in 0..found.phi.ncols() {
                    for i in 0..n {
                        bytes.extend_from_slice(&found.phi[(i, j)].to_le_bytes());
                    }
                }
                std::fs::write(format!("{name}.{}.phi", std::env::var("TAG").unwrap_or("x".into())), &bytes).unwrap();
                println!("{name} n {n} v {v} f {f}: {t:.2} s {:?}", found.refinement);
            }
            Err(e) => println!("{name}: {e}"),
        }
    }
}
