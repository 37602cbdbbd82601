"""Progress checker, recovery behaviors and the policy between them."""
