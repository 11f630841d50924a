"""The radio (II-A): who decodes whom."""
