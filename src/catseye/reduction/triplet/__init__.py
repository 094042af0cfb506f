"""Goldman's triplet units: H_corr from a laboratory sheet, and telescope use."""
