"""The extended Kalman filters: state, motion, association and correction [EKF 14-26]."""
