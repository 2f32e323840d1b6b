"""From images to people around the vehicle: detector, boxes, tracks, and what is not seen."""
