"""Energy that the method saves: the paper's equations, and costs fitted to runs."""
