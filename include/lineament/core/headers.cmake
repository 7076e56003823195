set(headers checks.hpp error.hpp image.hpp landmarks.hpp mesh.hpp random.hpp version.hpp)
