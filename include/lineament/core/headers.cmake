set(headers checks.hpp closest_point.hpp error.hpp image.hpp landmarks.hpp mesh.hpp procrustes.hpp random.hpp version.hpp)
