"""Classification of proposals, its budget, and the fusion of views."""
