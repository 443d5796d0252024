"""The method of Jeong & Kang as published, its misprints mended, with a true covariance."""
