"""From one east-north-up frame to another: each estimator has the anchor where it began."""
import numpy as np

_A, _F = 6378137.0, 1 / 298.257223563  # WGS84
_E2 = _F * (2 - _F)


def ecef(lat_deg, lon_deg, height_m):
    """Earth-centred, Earth-fixed coordinates of a geodetic position, m."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    radius = _A / np.sqrt(1 - _E2 * np.sin(lat) ** 2)
    return np.stack([(radius + height_m) * np.cos(lat) * np.cos(lon), (radius + height_m) * np.cos(lat) * np.sin(lon),
                     (radius * (1 - _E2) + height_m) * np.sin(lat)], axis=-1)


def enu_axes(lat_deg, lon_deg):
    """Columns east, north, up in ECEF."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    east = [-np.sin(lon), np.cos(lon), 0.0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    return np.array([east, north, up]).T


def anchor(channel, row=-1):
    """(lat_deg, lon_deg, height_m) of a pose channel's ENU frame in one of its messages."""
    return tuple(float(channel[f"anchor_{name}"][row]) for name in ("lat_deg", "lon_deg", "height_m"))


def change_anchor(position_m, old, new):
    """Positions (n x 3) in the ENU frame at `old` as positions in that at `new`, exact at any distance."""
    in_earth = ecef(*old) + np.asarray(position_m) @ enu_axes(*old[:2]).T
    return (in_earth - ecef(*new)) @ enu_axes(*new[:2])
