"""Goldman's triplet units: from a laboratory sheet to H_corr, and their use on the telescope."""
