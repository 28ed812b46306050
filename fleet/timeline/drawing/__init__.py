"""What of the fleet is drawn, and how, as rows of a Rerun recording."""
