//! Client of the CageR encoding service.
