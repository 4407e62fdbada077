//! The judge: closed forms and a CPU path tracer in f64.
