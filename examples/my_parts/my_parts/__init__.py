"""Parts of an outside package, which docs/how-to/write-your-own.md explains."""
