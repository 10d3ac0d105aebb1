"""Many runs: what a sweep file asks for, running it on all cores or a cluster, and the results."""
