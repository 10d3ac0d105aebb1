"""Many runs: what a sweep file asks for, doing it on as many cores as there are, and what came of it."""
