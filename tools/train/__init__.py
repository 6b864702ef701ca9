"""Data sets of crops, and training and export of the classifiers."""
