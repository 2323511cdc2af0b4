import numpy as np


class Tunnelling:
    name = "tunnelling"
    formula = "{} * exp(({}) * e + ({}) * e^2)"
    logarithmic = True

    def ratio(self, a, strain):
        return np.exp(strain * (a[..., 0] + strain * a[..., 1]))

    def slope(self, a, strain):
        return (a[..., 0] + 2 * strain * a[..., 1]) * self.ratio(a, strain)

    def basis(self, strain):
        return np.vander(strain, 3, increasing=True)


TUNNELLING = Tunnelling()
