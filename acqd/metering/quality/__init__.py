"""Power quality: quantities of 10/12-cycle intervals and what IEC 61000-4-30 aggregates from them; numpy only."""
