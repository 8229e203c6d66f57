"""The two covariances of one wall as MathML, which browsers typeset by themselves."""

from lidarcore import reporting

_SUM = "<munder><mo>∑</mo><mi>i</mi></munder>"
_INVERSE = "<mrow><mo>−</mo><mn>1</mn></mrow>"


def _indexed(letter: str, upper: str = "") -> str:
    base = f"<mi>{letter}</mi>"
    if upper:
        return f"<msubsup>{base}<mi>i</mi>{upper}</msubsup>"
    return f"<msub>{base}<mi>i</mi></msub>"


def _square(letter: str) -> str:
    return _indexed(letter) + _indexed(letter, "<mi>⊤</mi>")


def _display(content: str) -> str:
    return f'<math display="block" style="margin: .9rem 0; font-size: 1.15rem">{content}</math>'


_C, _N = "<mi>C</mi>", "<mi>n</mi>"
_SLICE, _SHADOW = _indexed("v", "<mtext>slice</mtext>"), _indexed("v", "<mtext>shadow</mtext>")
_TRANSPOSED = f"<msup>{_N}<mi>⊤</mi></msup>"

_PUBLISHED = _display(
    f"{_SLICE}<mo>=</mo><mfrac><mn>1</mn><mrow>{_TRANSPOSED}{_indexed('C', _INVERSE)}{_N}</mrow></mfrac>"
) + _display(
    f"{_C}<mo>=</mo><msup><mrow><mo>(</mo>{_SUM}<mfrac><mrow>{_square('a')}</mrow>{_SLICE}</mfrac><mo>)</mo></mrow>"
    f"{_INVERSE}</msup>"
)
_CONSISTENT = _display(f"{_SHADOW}<mo>=</mo>{_TRANSPOSED}{_indexed('C')}{_N}") + _display(
    f"{_C}<mo>=</mo>{_SUM}{_SHADOW}{_square('g')}"
)


def formulas() -> str:
    """Both beside each other."""
    panels = [("Published by CWLF and WCTLS", _PUBLISHED), ("Consistent, for every method", _CONSISTENT)]
    return reporting.figure("The covariance of a line's angle and distance.", panels)
