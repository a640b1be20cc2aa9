//! Following frames: a limited number of recoveries at a time, tenants in turn, on the threads of the lowest priority.

use super::finish::{refused, results};
use super::source::StoredSurfaces;
use super::valid_options::ValidOptions;
use super::{Finished, FollowedCage, Recovery, RecoveryJob};
use crate::admission::Permit;
use crate::jobs::{Ended, Jobs, MAX_ATTEMPTS, Phase, Run};
use crate::preparation::{cage_of, read_part_with_units};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{RecoveryParts, StoreError, Workshop};
use crate::sync::lock;
use cager_capture::origin::move_to;
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_motion::recover::{
    FirstLook, Person, RecoverError, RecoverJob, RecoverProgress, cage_around, manifold_of, placed_units, recover,
    rig_of,
};
use cager_shape::people::COORDINATES;
use std::sync::Arc;

impl Run for Recovery {
    fn jobs(service: &Service) -> &Arc<Jobs<Self>> {
        &service.recoveries
    }

    async fn turn(service: &Service, job: &Arc<RecoveryJob>) -> Option<Permit> {
        let mut changes = job.changes();
        changes.mark_unchanged();
        // Where it could not be deleted it goes on.
        let has_work = job.status().progress.has_work() && !job.is_going();
        if has_work {
            return service.place(job, &service.recovering).await;
        }
        tokio::select! {
            _ = changes.changed() => {}
            () = job.deleted().cancelled() => {}
            () = service.stopping().cancelled() => {}
        }
        None
    }

    fn work(service: &Arc<Service>, job: &Arc<RecoveryJob>, place: Permit) -> Ended<Finished> {
        Arc::clone(service).recover(job, place)
    }
}

impl Service {
    /// Follows frames until there are none for a while, or to the end. Blocks.
    fn recover(self: Arc<Self>, job: &Arc<RecoveryJob>, place: Permit) -> Ended<Finished> {
        let source = StoredSurfaces::new(Arc::clone(&self), Arc::clone(job), place);
        match source.begin() {
            Ok(true) => {}
            Ok(false) => {
                let detail = format!(
                    "the service ended {MAX_ATTEMPTS} times while this recovery ran, without getting further, so it is given up; its frames are kept until it is deleted: restart the service with more memory, or make the recovery anew with a lighter template, or lighter frames"
                );
                tracing::warn!(job = job.id(), "a recovery that ended the service again and again is given up");
                return Ended::GivenUp(ApiError::new(problem::RECOVERY_FAILED, detail));
            }
            Err(_) if source.is_stopped() => return Ended::Paused,
            Err(error) => return Ended::Failed(job.fail_if_damaged(&self.store, error)),
        }
        let ended = match self.recover_from(job, &source) {
            _ if source.is_stopped() => Ended::Paused,
            Ok(Some((finished, workshop))) => Ended::Completed(Box::new(finished), workshop),
            Ok(None) => Ended::Paused,
            Err(error) => Ended::Failed(lock(&source.failure).take().unwrap_or(error)),
        };
        // Here, since nothing new is begun when the service stops.
        source.pause();
        ended
    }

    fn recover_from(
        &self,
        job: &Arc<RecoveryJob>,
        source: &StoredSurfaces,
    ) -> Result<Option<(Finished, Workshop)>, ApiError> {
        let (meta, pool) = (&job.meta, self.designs.threads());
        let damaged = |error: StoreError| job.fail_if_damaged(&self.store, error);
        let ValidOptions { recover: options, person, goal } =
            ValidOptions::of(&meta.options, meta.parts.rig.is_some())?;
        let RecoveryParts { template, cage, rig, manifold } = self.store.recovery_parts(meta).map_err(damaged)?;
        let (mut model, said) = read_part_with_units("template", &template.name, &template.bytes)?;
        // Nothing asks for them, as on the command line.
        model.surface.pictures.clear();
        move_to(meta.origin, &mut model.points);
        let unusable = |detail: String| ApiError::new(problem::INVALID_GEOMETRY, detail);
        let known = match rig.zip(manifold) {
            None => None,
            Some((rig, manifold)) => {
                let rig = rig_of(&rig.bytes).map_err(unusable)?;
                Some((manifold_of(&manifold.bytes, &rig).map_err(unusable)?, rig))
            }
        };
        let no_cage = |error: &dyn std::fmt::Display| unusable(format!("template: {}: {error}", template.name));
        let cage = match (&known, cage) {
            (Some((_, rig)), _) => Cage::new(rig.cage()).map_err(|error| no_cage(&error))?,
            (None, Some(file)) => cage_of(&file, meta.origin)?,
            (None, None) => {
                let made = pool.install(|| cage_around(&model)).map_err(|error| no_cage(&error))?;
                Cage::new(made).map_err(|error| no_cage(&error))?
            }
        };
        job.set_phase(Phase::Running);
        let workshop = self.store.workshop()?;
        let person = known.as_ref().map(|(manifold, rig)| Person { rig, manifold, options: person });
        let system = if person.is_some() { COORDINATES } else { &MeanValue };
        let recovering = RecoverJob {
            template: model,
            cage,
            person,
            source,
            pool: Some(pool),
            frame_rate: meta.options.frame_rate,
            origin: meta.origin,
            options,
            scratch: workshop.path(),
        };
        let recovered = match recover(recovering, &|told| job.told(source, told)) {
            Ok(recovered) => recovered,
            Err(RecoverError::Stopped) => return Ok(None),
            Err(error) => return Err(refused(&error)),
        };
        let units = placed_units(said, options.up, [options.align, options.scale]);
        let encoded = results(job, recovered, (system, goal, units), pool, &workshop, source);
        encoded.map(|finished| Some((finished, workshop))).map_err(|error| ApiError::from(&error))
    }
}

impl RecoveryJob {
    /// Takes over what a run tells. A run begins with the first frame, and finds what the one before found.
    fn told(&self, source: &StoredSurfaces, told: RecoverProgress<'_>) {
        if let RecoverProgress::Followed(FirstLook { frame, .. }) = told {
            source.followed(frame as u32 + 1);
        }
        self.progressed(|progress| match told {
            RecoverProgress::Followed(FirstLook { frame, cage, joints, score, outcome })
                if frame == progress.followed.len() =>
            {
                let cage = cage.iter().map(|point| point.map(|x| x as f32)).collect();
                progress.followed.push(FollowedCage { cage, joints: joints.to_vec(), score, outcome });
                metrics::counter!("cager_recovered_frames_total", "tenant" => self.meta.tenant.clone()).increment(1);
            }
            RecoverProgress::Followed(_) => {}
            RecoverProgress::Refined(done) => progress.refined = done as u32,
        });
    }
}
