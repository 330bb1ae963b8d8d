"""Answers of the program about a set of measurements, compared with the right ones."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Judgement:
    """One value of one set.

    Attributes:
        of: name of the set.
        what: quantity or question.
        value: value given by the program, or its refusal.
        right: right value.
        is_right: whether the value is right.
    """

    of: str
    what: str
    value: str
    right: str
    is_right: bool

    def line(self) -> str:
        verdict = "right" if self.is_right else "WRONG"
        return f"{verdict}  {self.of}: {self.what}: {self.value} (right: {self.right})"


def near(of, what, value, right, within, unit="") -> Judgement:
    """Judge a number."""
    text = f"{value:.4g} {unit}".rstrip()
    wanted = f"{right:.4g} ± {within:.2g} {unit}".rstrip()
    return Judgement(of, what, text, wanted, abs(value - right) <= within)


def at_most(of, what, value, most, unit="") -> Judgement:
    """Judge a number that may not be larger."""
    text = f"{value:.4g} {unit}".rstrip()
    return Judgement(of, what, text, f"<= {most:g} {unit}".rstrip(), value <= most)


def says(of, what, text, words) -> Judgement:
    """Judge whether a text says all `words`; shows the text around the first."""
    is_contained = all(word in text for word in words)
    plain = " ".join(text.split())
    begin = max(plain.find(words[0]) - 60, 0)
    shown = plain[begin : begin + 150] or "plain success"
    return Judgement(of, what, shown, f"says {', '.join(words)}", is_contained)
