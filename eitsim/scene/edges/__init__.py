"""Where flat skins end: what every edge answers, a disc by formulas, outlines by polygons."""
