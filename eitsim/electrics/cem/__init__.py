"""The complete electrode model: assembly, boundary integral, scattering by rings, adjoint."""
