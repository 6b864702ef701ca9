"""Training of the classifiers on labelled recordings: crops, network, folds, export and card (extra train)."""
