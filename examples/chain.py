"""The whole chain in Python, from synthetic test files to a touch that is read from its voltages.

Run it in a folder that holds data_raw and examples, such as the checkout: python examples/chain.py
"""

import eitsim
import matcal
import surrogate

if __name__ == "__main__":  # worker processes import this file
    card = matcal.fit(["data_raw/uniaxial.csv", "data_raw/shear.csv",
                       {"conductivity": ["data_raw/mts_stretch.txt", "data_raw/nova_stretch.txt"]}],
                      specimen="data_raw/specimen.toml").card
    touch = eitsim.simulate(eitsim.Scene(punches=[eitsim.Punch(x_m=0.02, diameter_m=0.014, force_N=1.0)]), card)
    data = eitsim.sweep("examples/design.toml", card, out="sweep", scenes=60, workers=2)
    model = surrogate.train(data, method="forward", seed=1)
    found = model.predict(touch.readings.touched_V, touch.readings.baseline_V)
    print(found[["x0_m", "y0_m", "d_m", "F_N", "F_lo90_N", "F_hi90_N"]])
