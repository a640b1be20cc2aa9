//! One template of `cager recover` over its frames: followed, encoded, told.

use super::cage_file::read_cage;
use super::coding_args::goal;
use super::outputs::folder_of;
use super::recover_args::{Align, JointsKind, PersonMethod, RecoverArgs};
use super::{counted, grouped, human_bytes, progress};
use anyhow::{Context, Result};
use cager_capture::encode::{EncodeProgress, Encoded};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_formats::{AtomicFile, MeshSequence, ScratchDir, Target, Units};
use cager_geometry::mesh::{Model, Point};
use cager_motion::recover::{
    Encoding, JOINTS_RATE, Person, RecoverJob, RecoverOptions, RecoverProgress, Recovered, RecoveryReport, cage_around,
    gait_svg, recover,
};
use cager_proto::report::json_file;
use cager_shape::people::manifold::Manifold;
use cager_shape::people::rig::Rig;
use cager_shape::people::{COORDINATES, FitOptions, Method};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

fn person_options(method: PersonMethod) -> FitOptions {
    let method = match method {
        PersonMethod::Robust => Method::Robust,
        PersonMethod::Paper => Method::Paper,
    };
    FitOptions { method, ..FitOptions::default() }
}

/// One template over its frames.
pub(super) struct Stretching<'a> {
    pub(super) args: &'a RecoverArgs,
    pub(super) path: &'a Path,
    pub(super) person: Option<&'a (Rig, Manifold)>,
    pub(super) cage: Option<&'a PathBuf>,
    pub(super) origin: Option<Point>,
    /// What the recovered positions mean.
    pub(super) units: Units,
    pub(super) files: &'a MeshSequence,
    pub(super) output: &'a Target,
}

/// Files beside a container.
#[derive(Default)]
pub(super) struct Beside {
    pub(super) report: Option<AtomicFile>,
    pub(super) joints: Option<(AtomicFile, JointsKind)>,
    pub(super) gait: Option<AtomicFile>,
}

/// What a stretch comes to: files that are complete but have no names yet, and what is told when they have.
pub(super) struct Done {
    pub(super) files: Vec<AtomicFile>,
    pub(super) warnings: Vec<String>,
    pub(super) summary: String,
}

impl Stretching<'_> {
    pub(super) fn recover(&self, template: Model, beside: Beside) -> Result<Done> {
        let cage = match self.person {
            Some((rig, _)) => Cage::new(rig.cage()).context("--rig")?,
            None => self.cage(&template)?,
        };
        let scratch = ScratchDir::create(folder_of(self.output))?;
        let options = person_options(self.args.method);
        let known = self.person.map(|(rig, manifold)| Person { rig, manifold, options });
        let system = if known.is_some() { COORDINATES } else { &MeanValue };
        let recovered = self.followed((template, cage), known, scratch.path())?;
        self.encoded(system, recovered, beside)
    }

    /// The cage that is given, or one around the template.
    fn cage(&self, template: &Model) -> Result<Cage> {
        if let Some(path) = self.cage {
            return read_cage(path, (self.origin, Units::UNKNOWN));
        }
        let bar = progress::ticking("making a cage");
        let made = cage_around(template);
        bar.finish_and_clear();
        let named = || self.path.display().to_string();
        Cage::new(made.with_context(named)?).with_context(named)
    }

    fn followed(
        &self,
        (template, cage): (Model, Cage),
        person: Option<Person<'_>>,
        scratch: &Path,
    ) -> Result<Recovered> {
        let Self { args, files, origin, .. } = *self;
        let job = RecoverJob {
            template,
            cage,
            person,
            source: files,
            pool: None,
            frame_rate: args.timing.fps,
            origin,
            options: RecoverOptions {
                align: args.align == Align::Auto,
                scale: args.scale == Align::Auto,
                up: args.up,
                offsets: args.offsets,
                force: args.force,
                points: args.points as usize,
                colors: args.colors,
            },
            scratch,
        };
        let (there, back) = (progress::frames("following", files.files.len()), OnceLock::new());
        let recovered = recover(job, &|told| match told {
            RecoverProgress::Followed(found) => there.set_position(found.frame as u64 + 1),
            RecoverProgress::Refined(done) => {
                there.finish_and_clear();
                back.get_or_init(|| progress::frames("refining", files.files.len())).set_position(done as u64);
            }
        });
        there.finish_and_clear();
        back.into_inner().inspect(indicatif::ProgressBar::finish_and_clear);
        Ok(recovered?)
    }

    /// Encodes what was recovered.
    fn encoded(&self, system: &'static dyn CoordinateSystem, recovered: Recovered, beside: Beside) -> Result<Done> {
        let Self { args, output, origin, units, .. } = *self;
        let Recovered { rest, cage, mut frames, report, joints, mut warnings, .. } = recovered;
        let count = report.frames.len();
        let goal = goal(&args.coding, units, true, &rest, count)?;
        if args.offsets && goal.is_none() {
            warnings.push(
                "--offsets: cages alone are stored, without what leaves them; add --max-error to store that too"
                    .to_owned(),
            );
        }
        let bar = progress::PreparationBar::new("encoding", count);
        let (offsets, exact_rest) = (args.offsets, args.coding.exact_rest);
        let encoding = Encoding { output, system, goal, offsets, origin, units, exact_rest };
        let result = encoding.write((&rest, &cage), &mut frames, &|told| match told {
            EncodeProgress::Preparing(step) => bar.preparing(step),
            EncodeProgress::Frames(done) => bar.done(done),
        });
        bar.finish();
        let Encoded { report: encoded, container } = result?;
        let mut files = Vec::new();
        if let Some(mut file) = beside.report {
            file.write_all(&json_file(&report)?)?;
            files.push(file);
        }
        if let Some(mut file) = beside.gait {
            file.write_all(gait_svg(&report, args.timing.fps).as_bytes())?;
            files.push(file);
        }
        let numbers: Vec<f64> = report.frames.iter().map(|frame| frame.number).collect();
        if let Some(((mut file, kind), joints)) = beside.joints.zip(joints) {
            match kind {
                JointsKind::Csv => file.write_all(joints.csv(&numbers).as_bytes())?,
                JointsKind::Bvh => file.write_all(&joints.bvh(args.timing.fps.unwrap_or(JOINTS_RATE)))?,
            }
            files.push(file);
        }
        files.push(container);
        let summary = summary(&report, &encoded, output.path());
        warnings.extend(encoded.warnings);
        Ok(Done { files, warnings, summary })
    }
}

fn summary(report: &RecoveryReport, encoded: &cager_proto::report::Report, output: &Path) -> String {
    let percent =
        |share: Option<f64>| share.map_or("not measured".to_owned(), |share| format!("{:.3} %", 100.0 * share));
    let count = |outcome: &str| report.frames.iter().filter(|frame| frame.outcome == outcome).count();
    let placed = report.placement.map_or_else(String::new, |placed| {
        format!("  placed  turned by {:.1} degrees, scaled by {:.4}\n", placed.degrees, placed.scale)
    });
    let apart = match report.departures.len() {
        0 => String::new(),
        1 => "; 1 part leaves its surface".to_owned(),
        parts => format!("; {} parts leave their surface", grouped(parts)),
    };
    let s = report.seconds;
    format!(
        "{}: {} of {} as cages of {} vertices\n\
         {placed}\x20 frames  {} followed from the one before, {} found by a wider search, {} lost{apart}\n\
         \x20 surface template to surface {}, surface to template {} of the diagonal, on average\n\
         \x20 size    {}; errors of encoding: L2 {} on average, L∞ {} at most\n\
         \x20 time    {:.3} s: {:.3} s to prepare, {:.3} s to follow, {:.3} s to refine\n",
        output.display(),
        counted(report.frames.len(), "frame"),
        counted(report.points, "point"),
        grouped(report.cage_vertices),
        grouped(count("followed")),
        grouped(count("wider_search")),
        grouped(report.lost.len()),
        percent(report.to_surface),
        percent(report.from_surface),
        human_bytes(encoded.bytes.output),
        percent(Some(encoded.error.l2_mean)),
        percent(Some(encoded.error.linf_max)),
        s.prepare + s.follow + s.refine,
        s.prepare,
        s.follow,
        s.refine,
    )
}
