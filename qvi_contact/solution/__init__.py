"""From (D2) back to mechanics: solve, result, contact line, stress, work, sampling, histories and limit loads."""
