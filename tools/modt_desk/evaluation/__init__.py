"""What a run was worth: summary, the paper's figures."""
