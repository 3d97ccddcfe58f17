"""Care of the lakehouse: what it holds, whether it is whole, and what to do where it is not."""
