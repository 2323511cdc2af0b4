from matcal.record.exporters.base import Target, Written


def write_marks(material):
    terms = [f"{mu:.6g} {alpha:.6g}" for mu, alpha in zip(material.mu, material.law.alpha, strict=True)]
    return Written(tuple(terms), ("mu and alpha, a term a line.",))


MARKS = Target("Marks", write_marks, lambda notes, lines: "\n".join([*(f"% {n}" for n in notes), *lines]) + "\n")
