"""The benchmark `mutations`: whether the tests notice a changed operator or number."""
