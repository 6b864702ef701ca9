"""Reports of energy and savings, as text, JSON and HTML pages."""
