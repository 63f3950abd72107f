"""The paper's Disney BRDF and dielectric interfaces: numpy references and Mitsuba plugins."""
