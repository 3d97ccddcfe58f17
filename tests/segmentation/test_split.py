"""The split of solutions honours its share everywhere, and never changes."""

from hypothesis import given
from hypothesis import strategies as st

from lmtr.segmentation.split import in_validation

shares = st.floats(0.01, 0.99)


@given(share=shares, begin=st.integers(0, 10**6), length=st.integers(1, 3000))
def test_any_stretch_of_solutions_holds_close_to_its_share(share, begin, length):
    """To within two solutions and a few more in longer stretches; chance would miss by √n."""
    held = sum(in_validation(index, share) for index in range(begin, begin + length))
    assert abs(held - share * length) < 2.0 + 0.3 * len(f"{length:b}")


@given(index=st.integers(0, 10**6), shares=st.tuples(shares, shares))
def test_a_larger_share_holds_out_the_same_solutions_and_more(index, shares):
    smaller, larger = sorted(shares)
    assert in_validation(index, larger) or not in_validation(index, smaller)
