"""Which ridges are stripe: each measured along its track and judged against the others."""

from extraction.stripe.verdict.stripes import Stripe, StripeVerdict, bridged, courses, judge

__all__ = ["Stripe", "StripeVerdict", "bridged", "courses", "judge"]
