//! Worlds: read back, driven through, compared.
