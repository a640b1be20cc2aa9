//! What a session's options say, and the key of what is prepared by them.

use crate::problem::{self, ApiError};
use crate::store::{Content, ContentKey, NamedFile};
use cager_capture::coding::{Goal, InversionChoices};
use cager_core::coordinates::{self, CoordinateSystem};
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;
use cager_proto::messages::SessionOptions;

/// Validated options, except the upper bound of `spectrum`, which depends on the cage.
#[derive(Clone, Copy)]
pub(crate) struct ValidOptions {
    pub(crate) system: &'static dyn CoordinateSystem,
    pub(crate) inversion: InversionChoices,
    pub(crate) flip_cage: bool,
    /// What the container is to meet; without it frames are stored as they are solved for.
    pub(crate) goal: Option<Goal>,
    pub(crate) exact_rest: bool,
    /// Number of frames, where it was given.
    pub(super) frames: u32,
}

/// Most characters of a name that a user gives.
const NAME_CHARACTERS: usize = 200;
/// Numbers of frames lie below.
const MAX_NUMBER: f64 = 1e9;

/// Refuses names that are too long, and rates and numbers of frames that are none.
///
/// # Errors
/// Such an option.
pub(crate) fn check_told(name: Option<&str>, frame_rate: Option<f64>, start: Option<f64>) -> Result<(), ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    if name.is_some_and(|name| name.chars().count() > NAME_CHARACTERS) {
        return refuse(format!("name: is longer than {NAME_CHARACTERS} characters; shorten it"));
    }
    if frame_rate.is_some_and(|rate| !(rate.is_finite() && rate > 0.0)) {
        return refuse("frame_rate: give a positive number of frames per second".to_owned());
    }
    if start.is_some_and(|start| start.is_nan() || start.abs() >= MAX_NUMBER) {
        return refuse("start: give the number of the first frame, or leave it out".to_owned());
    }
    Ok(())
}

impl ValidOptions {
    /// Validates what does not depend on the cage.
    ///
    /// # Errors
    /// An option that is unknown, out of range or not available.
    pub(crate) fn of(options: &SessionOptions) -> Result<Self, ApiError> {
        let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        check_told(options.name.as_deref(), options.frame_rate, None)?;
        if options.frames == Some(0) {
            return refuse(
                "frames: a capture has at least one frame; leave it out where their number is not known".to_owned(),
            );
        }
        let name = options.coordinates.as_deref().unwrap_or("mvc");
        let Some(system) = coordinates::by_name(name) else {
            let names = coordinates::SYSTEMS.map(CoordinateSystem::name).join(", ");
            return refuse(format!("coordinates: {name:?} is not available; give one of {names}"));
        };
        let wanted = options.handles.as_deref().unwrap_or(Handles::default().name());
        if !Handles::NAMES.contains(&wanted) {
            let names = Handles::NAMES.join(", ");
            return refuse(format!("handles: {wanted:?} is not available; give one of {names}"));
        }
        let Some(handles) = Handles::by_name(wanted, options.handle_count.map(|count| count as usize)) else {
            return refuse(format!("handle_count: {wanted} has a fixed number of handles; leave it out"));
        };
        let handles = (options.handles.is_some() || options.handle_count.is_some()).then_some(handles);
        let wanted = options.regularizer.as_deref().unwrap_or(Regularizer::default().name());
        let Some(regularizer) = Regularizer::by_name(wanted) else {
            let names: Vec<&str> = Regularizer::ALL.iter().map(|r| r.name()).collect();
            return refuse(format!("regularizer: {wanted:?} is not available; give one of {}", names.join(", ")));
        };
        if let Some(lambda) = options.lambda
            && !(lambda.is_finite() && lambda >= 0.0)
        {
            return refuse(format!("lambda: is {lambda}; give a finite number of at least 0"));
        }
        let spectrum = options.spectrum.map(|threshold| threshold as usize);
        let SessionOptions { lambda, flip_cage, exact_rest, .. } = *options;
        let goal = goal(options)?;
        let inversion = InversionChoices { system, handles, regularizer, spectrum, lambda, is_coded: goal.is_some() };
        let frames = options.frames.unwrap_or(0);
        Ok(Self { system, inversion, flip_cage, goal, exact_rest, frames })
    }
}

/// What the container is to meet.
///
/// # Errors
/// Options that contradict each other or are out of range.
pub(crate) fn goal(options: &SessionOptions) -> Result<Option<Goal>, ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    let SessionOptions { max_error, mean_error, target_size, quality, frames, .. } = options;
    let names = [
        max_error.map(|_| "max_error"),
        mean_error.map(|_| "mean_error"),
        target_size.map(|_| "target_size"),
        quality.as_ref().map(|_| "quality"),
    ];
    let given: Vec<&str> = names.into_iter().flatten().collect();
    if let [first, second, ..] = given[..] {
        return refuse(format!("{second}: is given beside {first}; give one of them"));
    }
    if let (&[name], Some(error)) = (&given[..], max_error.or(*mean_error))
        && !(error > 0.0 && error < 1.0)
    {
        return refuse(format!("{name}: is {error}; give a fraction of the rest pose's diagonal above 0 and below 1"));
    }
    if target_size.is_some() && frames.is_none() {
        return refuse("target_size: is shared out among the frames; give their number as frames".to_owned());
    }
    Ok(match quality.as_deref() {
        None => max_error.map(Goal::MaxError).or(mean_error.map(Goal::MeanError)).or(target_size.map(Goal::Size)),
        Some("preview") => Some(Goal::Preview),
        Some("standard") => Some(Goal::Standard),
        Some("master") => Some(Goal::MASTER),
        Some(other) => {
            return refuse(format!("quality: {other:?} is not available; give one of preview, standard, master"));
        }
    })
}

/// BLAKE3 digest of everything a solver depends on. It includes the tenant, so that one tenant's upload is never a cache hit for another.
pub(crate) fn content_key(
    tenant: &str,
    content: &Content,
    options: &SessionOptions,
    valid: &ValidOptions,
) -> ContentKey {
    let extension = |file: &NamedFile| file.name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    // Defaults are written out, so that an omitted option and its default give the same key; not those of `spectrum` and `handle_count`, which depend
    // on the cage, and not where frames are coded, where they depend on what else was given.
    let is_coded = valid.goal.is_some();
    let inversion = valid.inversion;
    let solving = SessionOptions {
        name: None,
        frame_rate: None,
        frames: None,
        // The cage's bytes are hashed below, whatever their source.
        cage: None,
        coordinates: Some(valid.system.name().to_owned()),
        handles: if is_coded { options.handles.clone() } else { Some(inversion.handles().name().to_owned()) },
        regularizer: Some(inversion.regularizer.name().to_owned()),
        lambda: if is_coded { options.lambda } else { Some(inversion.lambda()) },
        ..options.clone()
    };
    let solving = serde_json::to_vec(&solving).unwrap_or_default();
    let version = format!("cager solver {}", cager_core::SOLVER_VERSION);
    let (rest, cage) = (extension(&content.rest), extension(&content.cage));
    let parts: [&[u8]; 7] = [
        version.as_bytes(),
        tenant.as_bytes(),
        rest.as_bytes(),
        &content.rest.bytes,
        cage.as_bytes(),
        &content.cage.bytes,
        &solving,
    ];
    ContentKey::of(parts.into_iter().chain(content.matrix.as_ref().map(|matrix| matrix.bytes.as_slice())))
}
