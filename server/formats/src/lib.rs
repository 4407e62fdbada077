//! Readers for volume files; hostile input dies here.
