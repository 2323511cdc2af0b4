"""Pools of workers that outlive lost processes, on this machine or a cluster, and answers kept piece by piece."""
