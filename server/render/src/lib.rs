//! The GPU: ray caster, film, illumination methods.
