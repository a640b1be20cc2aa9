//! What `cager cage` writes: the cage, its report and its page.

use super::cage_args::CageArgs;
use super::outputs::Outputs;
use anyhow::{Result, bail};
use cager_compare::report_page::{Contents, NO_PAGE, ReportKind, ReportPage, ShownCage, ShownMesh};
use cager_formats::{AtomicFile, Target, model_bytes, obj_bytes};
use cager_geometry::mesh::{Model, TriMesh};
use cager_proto::report::json_file;
use serde::Serialize;
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

/// Points of the model that its page draws at the most, about.
const SHOWN_POINTS: usize = 40_000;

/// Where outputs go.
pub(super) struct Targets {
    pub(super) output: Option<Target>,
    pub(super) report: Option<Target>,
    pub(super) picture: Option<Target>,
}

impl Targets {
    pub(super) fn new(args: &CageArgs) -> Result<Self> {
        let inputs = args.rest.iter().chain(&args.frames).chain(&args.improve).chain(&args.repair).chain(&args.check);
        let mut outputs = Outputs::new(args.outputs, inputs)?;
        let output = args.output.as_ref().map(|path| outputs.text(path)).transpose()?;
        if let Some(output) = &output {
            // Fails early for an extension that is not written; any model will do.
            cage_bytes(output, &Model { points: vec![[0.0; 3]], ..Model::default() })?;
        }
        Ok(Self {
            output,
            report: args.report.as_ref().map(|path| outputs.text(path)).transpose()?,
            picture: args.picture.as_ref().map(|path| picture(path, &mut outputs)).transpose()?,
        })
    }

    /// The report and the picture of models and a cage, where they are asked for, complete but for their names.
    pub(super) fn complete(
        &self,
        report: &impl Serialize,
        (args, model, cage): (&CageArgs, &TriMesh, &TriMesh),
    ) -> Result<Vec<AtomicFile>> {
        let mut files = Vec::new();
        if let Some(target) = &self.report {
            files.push(complete_file(target, &json_file(report)?)?);
        }
        if let Some(target) = &self.picture {
            let geometry = CageGeometry {
                mesh: ShownMesh::new(model, args.up, SHOWN_POINTS),
                cage: ShownCage::new(cage),
                name: self.output.as_ref().map(Target::path).or(args.check.as_deref()).map(Path::to_string_lossy),
            };
            let program = env!("CARGO_PKG_VERSION");
            let contents = Contents { kind: ReportKind::Cage, program, figures: report, geometry: &geometry };
            let page = ReportPage::built_in().map(|page| page.with(&contents)).transpose()?;
            files.push(complete_file(target, &page.unwrap_or_default())?);
        }
        Ok(files)
    }
}

/// What the page of a cage draws, and the file that holds the cage.
#[derive(Serialize)]
struct CageGeometry<'a> {
    mesh: ShownMesh,
    cage: ShownCage,
    name: Option<Cow<'a, str>>,
}

/// Where a picture goes, which is a page.
fn picture(path: &Path, outputs: &mut Outputs) -> Result<Target> {
    let is_page = path.extension().is_some_and(|end| ["html", "htm"].iter().any(|page| end.eq_ignore_ascii_case(page)));
    if !is_page && path.as_os_str() != "-" {
        bail!(
            "--picture: {} does not end with .html; the picture is a page for a browser, in which model and cage turn: \
             name it cage.html, and save the view as PNG there",
            path.display()
        );
    }
    if ReportPage::built_in().is_none() {
        bail!("--picture: {NO_PAGE}");
    }
    outputs.text(path)
}

/// A cage as a mesh file of its target's name; standard output has none and gets `.obj`.
pub(super) fn cage_bytes(target: &Target, cage: &Model) -> Result<Vec<u8>> {
    if *target == Target::StandardOutput {
        return Ok(obj_bytes(cage));
    }
    Ok(model_bytes(target.path(), cage)?)
}

pub(super) fn complete_file(target: &Target, bytes: &[u8]) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(target)?;
    file.write_all(bytes)?;
    Ok(file)
}
