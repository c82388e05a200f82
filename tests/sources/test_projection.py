"""The projection of geographic coordinates agrees with PROJ."""

import numpy as np
import pytest

from interdrive.files.sources.projection import central_meridian, transverse_mercator, utm

#: Latitude, longitude; transverse Mercator about them with one decimal; UTM: values of PROJ, by pyproj.
PLACES = [
    ((50.89043319, 6.1756529), (-1713.132022, -1063.989494), (301366.671398, 5641440.946600)),
    ((50.78232, 6.07042), (-2086.148191, -1966.381575), (293490.142922, 5629710.411002)),
    ((35.9035558, 139.93339979), (3015.110740, 395.056897), (403751.196479, 3973776.861054)),
    ((48.17746538, 11.58829563), (-870.442960, -2505.648116), (692404.931985, 5339264.724113)),
    ((-33.8688, 151.2093), (860.497170, 3460.674433), (334368.633648, 6250948.345385)),
    ((39.0842, 117.2009), (77.871276, -1754.071993), (517375.653573, 4326139.620960)),
    ((0.0005, 0.0009), (100.187542, 55.287138), (166121.728883, 55.341332)),
    ((60.3913, 5.3221), (1218.588244, -969.140842), (297353.932729, 6700648.345232)),
    ((64.1466, -21.9426), (-2073.564036, 5195.626724), (454138.376516, 7113689.868974)),
    ((-54.8019, -68.303), (-192.927102, -211.511861), (544805.097451, 3927029.884699)),
]


@pytest.mark.parametrize(("place", "local", "of_zone"), PLACES)
def test_places_are_where_proj_has_them(place, local, of_zone):
    latitude, longitude = (np.array([value]) for value in place)
    origin = (round(place[0], 1), round(place[1], 1))
    np.testing.assert_allclose(transverse_mercator(latitude, longitude, origin), [local], atol=1e-6)
    np.testing.assert_allclose(utm(latitude, longitude, place), [of_zone], atol=1e-5)


def test_zones_are_wider_in_norway_and_on_svalbard():
    assert [central_meridian(place) for place in ((60.4, 5.3), (60.4, 2.9), (78.2, 15.6), (78.2, 20.9))] == [
        9,
        3,
        15,
        15,
    ]
