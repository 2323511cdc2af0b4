"""What the packages share and no physics: errors, files, the cache, worker pools, the version of the code."""
