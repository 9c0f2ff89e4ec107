"""The data of the inequality (D2), its linear algebra, and the residuals of its laws."""
