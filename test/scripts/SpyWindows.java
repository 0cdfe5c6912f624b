import java.awt.Frame;
import java.awt.Rectangle;
import java.awt.Robot;
import java.awt.image.BufferedImage;
import java.io.File;
import java.lang.reflect.Field;
import java.util.List;
import java.util.Map;
import java.util.function.IntPredicate;
import javax.imageio.ImageIO;
import javax.swing.JDesktopPane;
import javax.swing.JFrame;
import javax.swing.SwingUtilities;
import lcm.spy.ChannelData;
import lcm.spy.Spy;
import lcm.spy.SpyPlugin;

/** The installed lcm-spy with our plugins on a real screen: what they show is read back pixel by pixel. SpyWindows URL FOLDER. */
public class SpyWindows {
    private static Spy spy;

    private static Object field(String name) throws Exception {
        Field field = Spy.class.getDeclaredField(name);
        field.setAccessible(true);
        return field.get(spy);
    }

    private static ChannelData await(String channel) throws Exception {
        for (int i = 0; i < 300; ++i) {
            ChannelData found = (ChannelData) ((Map<?, ?>) field("channelMap")).get(channel);
            if (found != null && found.last != null) {
                return found;
            }
            Thread.sleep(100);
        }
        throw new IllegalStateException("lcm-spy never decoded " + channel);
    }

    /** What lcm-spy's menu does for a channel: a window with a desktop, and the plugin's action in it. */
    private static JFrame open(String plugin, String channel, int x, int y) throws Exception {
        ChannelData data = await(channel);
        for (Object found : (List<?>) field("plugins")) {
            SpyPlugin candidate = (SpyPlugin) found;
            if (!candidate.getClass().getName().equals("roadfix.spy." + plugin)) {
                continue;
            }
            if (!candidate.canHandle(data.fingerprint)) {
                throw new IllegalStateException(plugin + " does not take " + channel);
            }
            JFrame frame = new JFrame(channel);
            SwingUtilities.invokeAndWait(() -> {
                JDesktopPane desktop = new JDesktopPane();
                frame.add(desktop);
                frame.setSize(500, 500);
                frame.setVisible(true);
                candidate.getAction(desktop, data).actionPerformed(null);
                frame.setLocation(x, y);
                frame.toFront();
            });
            return frame;
        }
        throw new IllegalStateException("lcm-spy did not find " + plugin + " among " + field("plugins"));
    }

    private static int pixels(BufferedImage image, IntPredicate wanted) {
        int count = 0;
        for (int y = 0; y < image.getHeight(); ++y) {
            for (int x = 0; x < image.getWidth(); ++x) {
                count += wanted.test(image.getRGB(x, y) & 0xffffff) ? 1 : 0;
            }
        }
        return count;
    }

    /** Of the screen, until at least `least` pixels are as wanted. */
    private static void see(JFrame frame, String file, int least, IntPredicate wanted, String what) throws Exception {
        Robot robot = new Robot();
        int count = 0;
        for (int i = 0; i < 100; ++i) {
            BufferedImage seen = robot.createScreenCapture(new Rectangle(frame.getBounds()));
            count = pixels(seen, wanted);
            if (count >= least) {
                ImageIO.write(seen, "png", new File(file));
                System.out.println(what + ": " + count + " pixels");
                return;
            }
            Thread.sleep(100);
        }
        ImageIO.write(robot.createScreenCapture(new Rectangle(0, 0, 1280, 1024)), "png", new File(file));
        throw new IllegalStateException(what + ": only " + count + " of " + least + " pixels on the screen");
    }

    private static boolean near(int rgb, int wanted) {
        return Math.abs((rgb >> 16 & 255) - (wanted >> 16 & 255)) + Math.abs((rgb >> 8 & 255) - (wanted >> 8 & 255)) + Math.abs((rgb & 255) - (wanted & 255)) < 40;
    }

    public static void main(String[] arguments) {
        try {
            spy = new Spy(arguments[0]);
            String folder = arguments[1] + "/";
            JFrame picture = open("PicturePlugin", "CAMERA_LEFT", 0, 0);
            JFrame map = open("PosePlugin", "POSE_FUSED", 0, 400);
            JFrame light = open("HealthPlugin", "HEALTH", 600, 400);
            see(picture, folder + "picture.png", 20_000, rgb -> (rgb >> 16 & 255) == (rgb & 255) && (rgb >> 8 & 255) == (rgb & 255) && rgb != 0xffffff && rgb != 0,
                "a grey picture");
            see(picture, folder + "picture.png", 400, rgb -> near(rgb, 0x00ff00) || near(rgb, 0x00ffff), "tracks in it");
            see(map, folder + "map.png", 20, rgb -> near(rgb, 0x0000ff), "an ellipse");
            see(map, folder + "map.png", 100, rgb -> near(rgb, 0x35a53f) || near(rgb, 0xff8000), "a path");
            see(light, folder + "light.png", 8_000, rgb -> near(rgb, 0x35a53f) || near(rgb, 0xff8000) || near(rgb, 0xd22222), "a light");
            System.out.println("lcm-spy shows pictures, poses and health");
            System.exit(0);
        } catch (Throwable error) {
            System.out.println("failed: " + error);
            for (Frame frame : Frame.getFrames()) {
                System.out.println("window " + frame.getTitle() + " " + frame.getBounds());
            }
            System.exit(1);
        }
    }
}
