"""Training of the neural predictor; see README.md. Not part of the installed package."""
